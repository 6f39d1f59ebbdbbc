// The calibration of a whole field by Ceres' TinySolver, one heliostat after the other: the same model, the
// same six angles and the same observations as helio-rs from a cold start, all within the time.
//
//   tinysolver --input CAMPAIGNS [--variant scanned|printed|reduced] [--threads T] [--repeat R] [--output ANSWERS]
//
// The derivatives are analytic. `printed`: Guo 2015 section 4 as it stands, a cross product and a projection per
// parameter. `reduced`: helio-rs' own form, in which one vector per component of the spot serves every parameter.
// Both begin from references in helio-rs' closed form. `scanned`: derivatives as printed, and the cold start that
// one writes without that: all zeros but the first axis' reference, the best of a scan of the full turn.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include <ceres/tiny_solver.h>

namespace {

// Least that agrees in nine digits of S with the others; the defaults stop as soon as a step changes S/2 by
// less than 1e-6 m^2.
constexpr double kFunctionTolerance = 1e-13;
constexpr double kMinRepeatS = 0.02;

// As in the file: all along the mount's axes.
struct Observation {
  double sun[3], angles[2], plane[3][3], centre, spot[2];
};
static_assert(sizeof(Observation) == 17 * sizeof(double));

struct Row {
  double sun[3];              // along xi, eta, nt
  double axis1[2], axis2[2];  // cosine and sine
  double spot[2];
  double centre;
  double plane[3][3];         // xi, eta, nt along the mount's axes
  double sun_of_mount[3];
};

struct Heliostat {
  double offset;
  std::vector<Observation> observations;
};

using Vector = std::array<double, 3>;

inline double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// What both variants begin with: the tilt matrix A, and the axes about which both components of the tilt turn c.
struct Tilt {
  double matrix[3][3], by_a[3], by_b[3];

  Tilt(double a, double b) {
    const double square = a * a + b * b, psi = std::sqrt(square);
    double k, h, m;
    if (psi < 1e-2) {
      h = 0.5 - square * (1.0 / 24 - square / 720);
      m = 1.0 / 6 - square * (1.0 / 120 - square / 5040);
      k = 1.0 - m * square;
    } else {
      k = std::sin(psi) / psi;
      h = (1.0 - std::cos(psi)) / square;
      m = (1.0 - k) / square;
    }
    const double rows[3][3] = {{1 - h * a * a, -h * a * b, -k * a},
                               {-h * a * b, 1 - h * b * b, -k * b},
                               {k * a, k * b, 1 - h * square}};
    std::memcpy(matrix, rows, sizeof matrix);
    by_a[0] = -m * a * b, by_a[1] = 1 - m * b * b, by_a[2] = h * b;
    by_b[0] = m * a * a - 1, by_b[1] = m * a * b, by_b[2] = -h * a;
  }
};

struct Spots {
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = 6 };

  const std::vector<Row>* rows;
  double offset;
  bool printed;

  int NumResiduals() const { return 2 * static_cast<int>(rows->size()); }

  // Parameters: both components of the tilt, gamma0, tau1, alpha0, mu. The Jacobian is column-major.
  bool operator()(const double* x, double* residuals, double* jacobian) const {
    return printed ? as_printed(x, residuals, jacobian) : reduced(x, residuals, jacobian);
  }

  bool as_printed(const double* x, double* residuals, double* jacobian) const {
    const Tilt tilt(x[0], x[1]);
    const auto turned = [&](const Vector& c) {  // c A
      Vector n;
      for (int j = 0; j < 3; j++)
        n[j] = c[0] * tilt.matrix[0][j] + c[1] * tilt.matrix[1][j] + c[2] * tilt.matrix[2][j];
      return n;
    };
    const double cg0 = std::cos(x[2]), sg0 = std::sin(x[2]);
    const double ct = std::cos(x[3]), st = std::sin(x[3]);
    const double ca0 = std::cos(x[4]), sa0 = std::sin(x[4]);
    const double cm = std::cos(x[5]), sm = std::sin(x[5]);
    const Vector a3 = {tilt.matrix[2][0], tilt.matrix[2][1], tilt.matrix[2][2]};
    const Vector wa = turned({tilt.by_a[0], tilt.by_a[1], tilt.by_a[2]});
    const Vector wb = turned({tilt.by_b[0], tilt.by_b[1], tilt.by_b[2]});
    const size_t count = rows->size();
    for (size_t row = 0; row < count; row++) {
      const Row& o = (*rows)[row];
      const double cg = o.axis1[0] * cg0 + o.axis1[1] * sg0, sg = o.axis1[1] * cg0 - o.axis1[0] * sg0;
      const double ca = o.axis2[0] * ca0 + o.axis2[1] * sa0, sa = o.axis2[1] * ca0 - o.axis2[0] * sa0;
      // rows of B3 A, B1 B3 A and of the full product
      const Vector e1 = turned({cg, sg, 0}), f2 = turned({-sg, cg, 0});
      Vector e2, g3, e3, n;
      for (int j = 0; j < 3; j++) {
        e2[j] = ct * f2[j] + st * a3[j];
        g3[j] = ct * a3[j] - st * f2[j];
        e3[j] = ca * g3[j] - sa * e1[j];
        n[j] = cm * (ca * e1[j] + sa * g3[j]) + sm * e2[j];
      }
      const Vector s = {o.sun_of_mount[0], o.sun_of_mount[1], o.sun_of_mount[2]};
      const Vector xi = {o.plane[0][0], o.plane[0][1], o.plane[0][2]};
      const Vector eta = {o.plane[1][0], o.plane[1][1], o.plane[1][2]};
      const Vector nt = {o.plane[2][0], o.plane[2][1], o.plane[2][2]};
      const double sn = dot(s, n);
      Vector r, spot;
      for (int j = 0; j < 3; j++)
        r[j] = 2 * sn * n[j] - s[j];
      const double facing = dot(nt, r), beam = (o.centre - offset * dot(nt, n)) / facing;
      for (int j = 0; j < 3; j++)
        spot[j] = offset * n[j] + beam * r[j];
      residuals[2 * row] = dot(xi, spot) - o.spot[0];
      residuals[2 * row + 1] = dot(eta, spot) - o.spot[1];
      if (jacobian == nullptr)
        continue;
      const Vector axes[6] = {wa, wb, {-a3[0], -a3[1], -a3[2]}, e1, e2, e3};
      const double xr = dot(xi, r) / facing, er = dot(eta, r) / facing;
      for (int k = 0; k < 6; k++) {
        const Vector dn = cross(axes[k], n);
        const double sdn = dot(s, dn);
        Vector d;
        for (int j = 0; j < 3; j++)
          d[j] = offset * dn[j] + 2 * beam * (sdn * n[j] + sn * dn[j]);
        const double along = dot(nt, d);
        jacobian[2 * count * k + 2 * row] = dot(xi, d) - xr * along;
        jacobian[2 * count * k + 2 * row + 1] = dot(eta, d) - er * along;
      }
    }
    return true;
  }

  bool reduced(const double* x, double* residuals, double* jacobian) const {
    const Tilt t(x[0], x[1]);
    const auto& tilt = t.matrix;
    const auto& by_a = t.by_a;
    const auto& by_b = t.by_b;
    const double cg0 = std::cos(x[2]), sg0 = std::sin(x[2]);
    const double ct = std::cos(x[3]), st = std::sin(x[3]);
    const double ca0 = std::cos(x[4]), sa0 = std::sin(x[4]);
    const double cm = std::cos(x[5]), sm = std::sin(x[5]);
    const double ct_sm = ct * sm, st_cm = st * cm, st_sm = st * sm, ct_cm = ct * cm;
    const double hz = offset;
    const size_t count = rows->size();
    const double(*last)[3] = nullptr;
    double from[3][3] = {};
    for (size_t row = 0; row < count; row++) {
      const Row& o = (*rows)[row];
      if (last == nullptr || std::memcmp(last, o.plane, sizeof o.plane) != 0) {
        for (int i = 0; i < 3; i++)
          for (int j = 0; j < 3; j++)
            from[i][j] = tilt[i][0] * o.plane[j][0] + tilt[i][1] * o.plane[j][1] + tilt[i][2] * o.plane[j][2];
        last = o.plane;
      }
      const double cg = o.axis1[0] * cg0 + o.axis1[1] * sg0, sg = o.axis1[1] * cg0 - o.axis1[0] * sg0;
      const double ca = o.axis2[0] * ca0 + o.axis2[1] * sa0, sa = o.axis2[1] * ca0 - o.axis2[0] * sa0;
      const double d0 = cm * ca, d1 = ct_sm - st_cm * sa, d2 = st_sm + ct_cm * sa;
      const double c0 = cg * d0 - sg * d1, c1 = sg * d0 + cg * d1;
      double n[3];
      for (int j = 0; j < 3; j++)
        n[j] = c0 * from[0][j] + c1 * from[1][j] + d2 * from[2][j];
      const double twice = 2 * (o.sun[0] * n[0] + o.sun[1] * n[1] + o.sun[2] * n[2]);
      const double r0 = twice * n[0] - o.sun[0], r1 = twice * n[1] - o.sun[1];
      const double per_facing = 1 / (o.sun[2] - twice * n[2]);
      const double beam = (hz * n[2] - o.centre) * per_facing;
      residuals[2 * row] = beam * r0 + hz * n[0] - o.spot[0];
      residuals[2 * row + 1] = beam * r1 + hz * n[1] - o.spot[1];
      if (jacobian == nullptr)
        continue;
      const double stretch = beam * twice + hz;
      const double shear[2] = {r0 * per_facing, r1 * per_facing};
      const double pull[2] = {2 * beam * (n[0] + shear[0] * n[2]), 2 * beam * (n[1] + shear[1] * n[2])};
      const double t0 = stretch * n[0], t1 = stretch * n[1], t2 = stretch * n[2];
      const double x0 = n[1] * o.sun[2] - n[2] * o.sun[1];
      const double x1 = n[2] * o.sun[0] - n[0] * o.sun[2];
      const double x2 = n[0] * o.sun[1] - n[1] * o.sun[0];
      const double moments[2][3] = {
          {pull[0] * x0 + shear[0] * t1, pull[0] * x1 + t2 - shear[0] * t0, pull[0] * x2 - t1},
          {pull[1] * x0 + shear[1] * t1 - t2, pull[1] * x1 - shear[1] * t0, pull[1] * x2 + t0}};
      for (int i = 0; i < 2; i++) {
        const double* v = moments[i];
        const double mx = from[0][0] * v[0] + from[0][1] * v[1] + from[0][2] * v[2];
        const double my = from[1][0] * v[0] + from[1][1] * v[1] + from[1][2] * v[2];
        const double mz = from[2][0] * v[0] + from[2][1] * v[1] + from[2][2] * v[2];
        const double level = cg * mx + sg * my, across = cg * my - sg * mx;
        double* to = jacobian + 2 * row + i;
        const size_t stride = 2 * count;
        to[0] = by_a[0] * mx + by_a[1] * my + by_a[2] * mz;
        to[stride] = by_b[0] * mx + by_b[1] * my + by_b[2] * mz;
        to[2 * stride] = -mz;
        to[3 * stride] = level;
        to[4 * stride] = ct * across + st * mz;
        to[5 * stride] = ca * (ct * mz - st * across) - sa * level;
      }
    }
    return true;
  }
};

struct Answer {
  double values[6];
  double sum_of_squares;
};

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "tinysolver: %s\n", what.c_str());
  std::exit(2);
}

std::vector<Heliostat> read(const char* path) {
  std::FILE* file = std::fopen(path, "rb");
  if (file == nullptr)
    fail(std::string("cannot open ") + path);
  std::uint64_t counts[2];
  if (std::fread(counts, sizeof counts, 1, file) != 1)
    fail(std::string("too short: ") + path);
  std::vector<Heliostat> heliostats(counts[0]);
  for (Heliostat& heliostat : heliostats) {
    double head[3];  // the offset, and a start for peers that cannot find one
    heliostat.observations.resize(counts[1]);
    if (std::fread(head, sizeof head, 1, file) != 1 ||
        std::fread(heliostat.observations.data(), sizeof(Observation), counts[1], file) != counts[1])
      fail(std::string("too short: ") + path);
    heliostat.offset = head[0];
  }
  std::fclose(file);
  return heliostats;
}

Row prepared(const Observation& o) {
  Row row;
  row.axis1[0] = std::cos(o.angles[0]);
  row.axis1[1] = std::sin(o.angles[0]);
  row.axis2[0] = std::cos(o.angles[1]);
  row.axis2[1] = std::sin(o.angles[1]);
  std::memcpy(row.plane, o.plane, sizeof row.plane);
  std::memcpy(row.sun_of_mount, o.sun, sizeof row.sun_of_mount);
  for (int j = 0; j < 3; j++)
    row.sun[j] = o.plane[j][0] * o.sun[0] + o.plane[j][1] * o.sun[1] + o.plane[j][2] * o.sun[2];
  row.centre = o.centre;
  row.spot[0] = o.spot[0];
  row.spot[1] = o.spot[1];
  return row;
}

// Both references in closed form: each follows from the other by an arctangent of sums over the normals that
// halve sun and spot.
void start(const std::vector<Row>& rows, double* x) {
  double pc = 0, qc = 0, ps = 0, qs = 0, zs = 0, zc = 0;
  for (const Row& o : rows) {
    const double length = std::sqrt(o.spot[0] * o.spot[0] + o.spot[1] * o.spot[1] + o.centre * o.centre);
    const double half[3] = {o.sun[0] + o.spot[0] / length, o.sun[1] + o.spot[1] / length, o.sun[2] + o.centre / length};
    double h[3];
    for (int j = 0; j < 3; j++)
      h[j] = half[0] * o.plane[0][j] + half[1] * o.plane[1][j] + half[2] * o.plane[2][j];
    const double p = o.axis1[0] * h[0] + o.axis1[1] * h[1], q = o.axis1[1] * h[0] - o.axis1[0] * h[1];
    pc += o.axis2[0] * p, qc += o.axis2[0] * q, ps += o.axis2[1] * p, qs += o.axis2[1] * q;
    zs += o.axis2[1] * h[2], zc += o.axis2[0] * h[2];
  }
  double most = -1;
  for (int begin = 0; begin < 4; begin++) {
    double second = begin * 1.5707963267948966, first = 0, agreement = 0;
    for (int turn = 0; turn < 4; turn++) {
      const double c2 = std::cos(second), s2 = std::sin(second);
      first = std::atan2(c2 * qc + s2 * qs, c2 * pc + s2 * ps);
      const double c1 = std::cos(first), s1 = std::sin(first);
      const double along = c1 * pc + s1 * qc + zs, across = c1 * ps + s1 * qs - zc;
      second = std::atan2(across, along);
      agreement = along * along + across * across;
    }
    if (agreement > most) {
      most = agreement;
      x[2] = first;
      x[4] = second;
    }
  }
}

// The least cost of kScanned references of the first axis, everything else zero.
void scan(const Spots& spots, std::vector<double>& residuals, double* x) {
  constexpr int kScanned = 24;  // with 12 two in a hundred of the short campaigns end elsewhere
  double least = HUGE_VAL;
  residuals.resize(static_cast<size_t>(spots.NumResiduals()));
  for (int k = 0; k < kScanned; k++) {
    const double trial[6] = {0, 0, 2 * M_PI * k / kScanned, 0, 0, 0};
    spots(trial, residuals.data(), nullptr);
    double cost = 0;
    for (const double residual : residuals)
      cost += residual * residual;
    if (cost < least) {
      least = cost;
      x[2] = trial[2];
    }
  }
}

enum class Variant { kScanned, kPrinted, kReduced };

void fit(const std::vector<Heliostat>& heliostats, size_t begin, size_t end, Variant variant, std::vector<Answer>& answers) {
  ceres::TinySolver<Spots> solver;
  solver.options.function_tolerance = kFunctionTolerance;
  std::vector<Row> rows;
  std::vector<double> residuals;
  for (size_t i = begin; i < end; i++) {
    rows.clear();
    for (const Observation& observation : heliostats[i].observations)
      rows.push_back(prepared(observation));
    const Spots spots{&rows, heliostats[i].offset, variant != Variant::kReduced};
    Eigen::Matrix<double, 6, 1> x = Eigen::Matrix<double, 6, 1>::Zero();
    if (variant == Variant::kScanned)
      scan(spots, residuals, x.data());
    else
      start(rows, x.data());
    solver.Solve(spots, &x);
    std::copy_n(x.data(), 6, answers[i].values);
    answers[i].sum_of_squares = 2 * solver.summary.final_cost;
  }
}

void fit_all(const std::vector<Heliostat>& heliostats, size_t threads, Variant variant, std::vector<Answer>& answers) {
  const size_t count = heliostats.size();
  std::vector<std::thread> others;
  for (size_t t = 1; t < threads; t++)
    others.emplace_back([&, t] { fit(heliostats, t * count / threads, (t + 1) * count / threads, variant, answers); });
  fit(heliostats, 0, count / threads, variant, answers);
  for (std::thread& other : others)
    other.join();
}

}  // namespace

int main(int argc, char** argv) {
  const char *input = nullptr, *output = nullptr;
  std::string name = "printed";
  int threads = 1, repeat = 5;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string option = argv[i];
    if (option == "--input")
      input = argv[i + 1];
    else if (option == "--output")
      output = argv[i + 1];
    else if (option == "--variant")
      name = argv[i + 1];
    else if (option == "--threads")
      threads = std::atoi(argv[i + 1]);
    else if (option == "--repeat")
      repeat = std::atoi(argv[i + 1]);
    else
      fail("unknown option " + option);
  }
  if (input == nullptr || threads < 1 || repeat < 1 || (name != "scanned" && name != "printed" && name != "reduced"))
    fail("usage: --input CAMPAIGNS [--variant scanned|printed|reduced] [--threads T] [--repeat R] [--output ANSWERS]");
  const Variant variant = name == "scanned" ? Variant::kScanned : name == "printed" ? Variant::kPrinted : Variant::kReduced;
  const std::vector<Heliostat> heliostats = read(input);
  std::vector<Answer> answers(heliostats.size());
  const auto timed = [&](long loops) {
    const auto start = std::chrono::steady_clock::now();
    for (long loop = 0; loop < loops; loop++)
      fit_all(heliostats, static_cast<size_t>(threads), variant, answers);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  long loops = 1;
  while (timed(loops) < kMinRepeatS)
    loops *= 2;
  std::vector<double> seconds;
  for (int r = 0; r < repeat; r++)
    seconds.push_back(timed(loops) / static_cast<double>(loops));
  std::sort(seconds.begin(), seconds.end());
  if (output != nullptr) {
    std::FILE* file = std::fopen(output, "wb");
    if (file == nullptr || std::fwrite(answers.data(), sizeof(Answer), answers.size(), file) != answers.size() ||
        std::fclose(file) != 0)
      fail(std::string("cannot write ") + output);
  }
  const double n = static_cast<double>(heliostats.size());
  std::printf("{\"peer\": \"tinysolver_%s\", \"version\": \"%s\", \"heliostats\": %zu, \"observations\": %zu, "
              "\"threads\": %d, \"ns_per_fit\": {\"minimum\": %.6g, \"median\": %.6g}}\n",
              name.c_str(), __VERSION__, heliostats.size(), heliostats[0].observations.size(), threads, seconds[0] / n * 1e9,
              seconds[seconds.size() / 2] / n * 1e9);
  return 0;
}
