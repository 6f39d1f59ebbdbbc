/* Peer: C, the reduced form over columns, vectorised by the compiler with glibc's libmvec.
 *
 * Variants (--variant):
 *   loop   one `omp simd` loop over the rows, two C/k updates by division and square root, atan2 for
 *          both angles: the plain way to write it
 *   split  the fastest found: blocks that stay in the first-level cache, worked through in short loops,
 *          so that no vector lives across a call into libmvec and many rows are in flight; C/k updates
 *          as power series, good to 1e-14 rad from slant / offset 10; arcsine for elevation and
 *          incidence; the next block fetched ahead
 * Constants are prepared outside the timing; input, output and tolerances are those of common.py.
 */
#define _DEFAULT_SOURCE

/* Vector versions of the functions used, as <math.h> declares them only under -ffast-math. */
#define VECTORISED __attribute__((simd("notinbranch"), const, nothrow, leaf))
extern double acos(double) VECTORISED;
extern double asin(double) VECTORISED;
extern double atan2(double, double) VECTORISED;

#include <immintrin.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#define TWO_PI 6.283185307179586476925286766559
#define MIN_COS_INCIDENCE 1e-6
#define MIN_REPEAT_S 0.02
#define BLOCK 256 /* rows; the nine temporaries of a block take 18 KiB of the first-level cache */
/* From FAR rows on the columns come from memory: shorter blocks then mix fetching with computing, and
 * each asks for the rows AHEAD of it, and
 * the answers are written past the caches. */
#define FAR 50000
#define FAR_BLOCK 64
#define AHEAD 96

enum { OK = 0, UNREACHABLE = 1, OUTSIDE_LIMITS = 2, SUN_OPPOSES_AIM = 4 };

enum { /* columns of the input file */
    EAST, NORTH, UP, MIRROR_OFFSET, TILT_AZIMUTH, TILT, NONORTHOGONALITY, MIRROR_TILT,
    AZIMUTH_REFERENCE, ELEVATION_REFERENCE, AXIS1_MIN, AXIS1_MAX, AXIS2_MIN, AXIS2_MAX, INPUT_COLUMNS
};

struct sun {
    double east, north, up;
};

/* Thirteen constants of each heliostat, the four limits, and the answers. */
struct field {
    size_t n;
    double *target_east, *target_north, *target_up, *two_slants;
    double *tilt_north, *tilt_east, *tilt_w;
    double *sec_tau1, *tan_tau1_sin_mu, *tan_tau1, *sin_mu_sec_tau1;
    double *azimuth_reference, *elevation_reference;
    double *axis1_min, *axis1_max, *axis2_min, *axis2_max;
    double *azimuth, *elevation, *incidence;
    uint8_t *status;
};

static inline double wrapped(double angle)
{
    angle = angle < 0.0 ? angle + TWO_PI : angle;
    return angle >= TWO_PI ? angle - TWO_PI : angle;
}

#define COLUMN(name) const double *restrict name = f->name + first
#define ANSWER(name) double *restrict name = f->name + first

__attribute__((noinline)) static void track_loop(const struct field *f, struct sun sun, size_t first, size_t end)
{
    COLUMN(target_east); COLUMN(target_north); COLUMN(target_up); COLUMN(two_slants);
    COLUMN(tilt_north); COLUMN(tilt_east); COLUMN(tilt_w);
    COLUMN(sec_tau1); COLUMN(tan_tau1_sin_mu); COLUMN(tan_tau1); COLUMN(sin_mu_sec_tau1);
    COLUMN(azimuth_reference); COLUMN(elevation_reference);
    COLUMN(axis1_min); COLUMN(axis1_max); COLUMN(axis2_min); COLUMN(axis2_max);
    ANSWER(azimuth); ANSWER(elevation); ANSWER(incidence);
    uint8_t *restrict status = f->status + first;
    const size_t n = end - first;
#pragma omp simd
    for (size_t i = 0; i < n; i++) {
        const double t1 = target_north[i], t2 = target_east[i], t3 = target_up[i];
        const double cos_two_theta = sun.north * t1 + sun.east * t2 + sun.up * t3;
        const double sin_squared = 0.5 - 0.5 * cos_two_theta;
        const double cos_theta = sqrt(0.5 + 0.5 * cos_two_theta);
        /* (9): ratio = C / (2L/Hz C - cos(theta)), C = sqrt(1 - ratio^2 sin(theta)^2), from C = 1 */
        const double slants = two_slants[i];
        double ratio = 1.0 / (slants - cos_theta);
        double cos_tau = sqrt(1.0 - ratio * ratio * sin_squared);
        ratio = cos_tau / (slants * cos_tau - cos_theta);
        cos_tau = sqrt(1.0 - ratio * ratio * sin_squared);
        ratio = cos_tau / (slants * cos_tau - cos_theta);
        const double cos_incidence = cos_tau * cos_theta - ratio * sin_squared;
        /* (16): n = (along - across) s + (along + across) t */
        const double sun_part = 0.5 * (cos_tau / cos_theta - ratio), target_part = sun_part + ratio;
        const double n1 = sun_part * sun.north + target_part * t1;
        const double n2 = sun_part * sun.east + target_part * t2;
        const double n3 = sun_part * sun.up + target_part * t3;
        /* c = A n */
        const double p = tilt_north[i], q = tilt_east[i], w = tilt_w[i];
        const double tilt = p * n1 + q * n2, lift = n3 + w * tilt;
        const double c1 = n1 - p * lift, c2 = n2 - q * lift;
        const double c3 = n3 * (1.0 - w * (p * p + q * q)) + tilt;
        /* (22)-(27) */
        const double d2 = sin_mu_sec_tau1[i] - tan_tau1[i] * c3;
        const double d1_squared = c1 * c1 + c2 * c2 - d2 * d2;
        const double d1 = sqrt(d1_squared > 0.0 ? d1_squared : 0.0);
        const double rise = c3 * sec_tau1[i] - tan_tau1_sin_mu[i];
        const double elevation_i = atan2(rise, d1) + elevation_reference[i];
        const double azimuth_i = wrapped(atan2(c2 * d1 - c1 * d2, c1 * d1 + c2 * d2) + azimuth_reference[i]);
        const double incidence_i = 0.5 * acos(cos_two_theta);
        const int outside = (azimuth_i < axis1_min[i]) | (azimuth_i > axis1_max[i])
                          | (elevation_i < axis2_min[i]) | (elevation_i > axis2_max[i]);
        double code = outside ? OUTSIDE_LIMITS : OK;
        code = d1_squared < 0.0 ? UNREACHABLE : code;
        code = cos_incidence > MIN_COS_INCIDENCE ? code : SUN_OPPOSES_AIM;
        azimuth[i] = code == OK ? azimuth_i : NAN;
        elevation[i] = code == OK ? elevation_i : NAN;
        incidence[i] = code == OK ? incidence_i : NAN;
        status[i] = (uint8_t)(int)code;
    }
}

/* Asks for part of a column; harmless past its end. */
static inline void fetch(const double *column, int rows)
{
    for (int i = 0; i < rows; i += 8)
        __builtin_prefetch(column + AHEAD + i, 0, 2);
}

/* Writes answers past the caches; they are not read again soon. */
static inline void stream(double *restrict to, const double *restrict from, int n)
{
    int i = 0;
#ifdef __AVX512F__
    for (; i + 8 <= n; i += 8)
        _mm512_stream_pd(to + i, _mm512_load_pd(from + i));
#elif defined __AVX__
    for (; i + 4 <= n; i += 4)
        _mm256_stream_pd(to + i, _mm256_load_pd(from + i));
#endif
    for (; i < n; i++)
        to[i] = from[i];
}

#define EACH_ROW _Pragma("omp simd") for (int i = 0; i < n; i++)

__attribute__((noinline)) static void track_split(const struct field *f, struct sun sun, size_t start, size_t end)
{
    _Alignas(64) double cos_of[BLOCK], square_of[BLOCK], ratio_of[BLOCK], cos_tau_of[BLOCK], theta_of[BLOCK];
    _Alignas(64) double c1_of[BLOCK], c2_of[BLOCK], c3_of[BLOCK], code_of[BLOCK];
    const int far = f->n >= FAR;
    const size_t block = far ? FAR_BLOCK : BLOCK;
    const int ahead = far ? FAR_BLOCK : 0;
    for (size_t first = start; first < end; first += block) {
        const int n = (int)(end - first < block ? end - first : block);
        COLUMN(target_east); COLUMN(target_north); COLUMN(target_up); COLUMN(two_slants);
        COLUMN(tilt_north); COLUMN(tilt_east); COLUMN(tilt_w);
        COLUMN(sec_tau1); COLUMN(tan_tau1_sin_mu); COLUMN(tan_tau1); COLUMN(sin_mu_sec_tau1);
        COLUMN(azimuth_reference); COLUMN(elevation_reference);
        COLUMN(axis1_min); COLUMN(axis1_max); COLUMN(axis2_min); COLUMN(axis2_max);
        double *const azimuth = far ? c1_of : f->azimuth + first;
        double *const elevation = far ? c3_of : f->elevation + first;
        double *const incidence = far ? theta_of : f->incidence + first;
        uint8_t *restrict status = f->status + first;

        EACH_ROW
        {
            const double cos_two_theta =
                sun.north * target_north[i] + sun.east * target_east[i] + sun.up * target_up[i];
            const double sin_squared = 0.5 - 0.5 * cos_two_theta;
            const double cos_theta = sqrt(0.5 + 0.5 * cos_two_theta);
            square_of[i] = sin_squared;
            cos_of[i] = cos_theta;
            theta_of[i] = sqrt(sin_squared);
            ratio_of[i] = 1.0 / (two_slants[i] - cos_theta);
        }
        fetch(two_slants, ahead);
        fetch(target_east, ahead);
        /* (9) as ratio = 1/(2L/Hz - cos(theta)/C): each update divides the first guess by 1 - y, where
         * y = guess cos(theta) (1/C - 1) and 1/C - 1 is a series in x = sin(tau)^2. */
        EACH_ROW
        {
            const double guess = ratio_of[i], per_excess = guess * cos_of[i], per_square = square_of[i];
            double x = guess * guess * per_square;
            double ratio = guess + guess * (per_excess * (x * (0.5 + 0.375 * x)));
            x = ratio * ratio * per_square;
            const double excess = x * ((0.5 + 0.375 * x) + x * x * ((0.3125 + 0.2734375 * x) + 0.24609375 * x * x));
            const double y = per_excess * excess;
            ratio = guess + guess * (y + y * y);
            x = ratio * ratio * per_square;
            ratio_of[i] = ratio;
            cos_tau_of[i] = 1.0 - x * ((0.5 + 0.125 * x) + x * x * ((0.0625 + 0.0390625 * x) + 0.02734375 * x * x));
        }
        fetch(target_north, ahead);
        fetch(target_up, ahead);
        EACH_ROW /* (16): n = (along - across) s + (along + across) t, then c = A n */
        {
            const double ratio = ratio_of[i], cos_tau = cos_tau_of[i], cos_theta = cos_of[i];
            const double cos_incidence = cos_tau * cos_theta - ratio * square_of[i];
            code_of[i] = cos_incidence > MIN_COS_INCIDENCE ? OK : SUN_OPPOSES_AIM;
            const double sun_part = 0.5 * (cos_tau / cos_theta - ratio), target_part = sun_part + ratio;
            const double n1 = sun_part * sun.north + target_part * target_north[i];
            const double n2 = sun_part * sun.east + target_part * target_east[i];
            const double n3 = sun_part * sun.up + target_part * target_up[i];
            const double p = tilt_north[i], q = tilt_east[i], w = tilt_w[i];
            const double tilt = p * n1 + q * n2, lift = n3 + w * tilt;
            c1_of[i] = n1 - p * lift;
            c2_of[i] = n2 - q * lift;
            c3_of[i] = n3 * (1.0 - w * (p * p + q * q)) + tilt;
        }
        fetch(tilt_north, ahead);
        fetch(tilt_east, ahead);
        fetch(tilt_w, ahead);
        EACH_ROW /* (22)-(26): sine of the elevation; sine and cosine of the azimuth, not normalised */
        {
            const double c1 = c1_of[i], c2 = c2_of[i], c3 = c3_of[i];
            const double d2 = sin_mu_sec_tau1[i] - tan_tau1[i] * c3;
            const double d1_squared = c1 * c1 + c2 * c2 - d2 * d2;
            const double d1 = sqrt(d1_squared > 0.0 ? d1_squared : 0.0);
            c1_of[i] = c2 * d1 - c1 * d2;
            c2_of[i] = c1 * d1 + c2 * d2;
            c3_of[i] = c3 * sec_tau1[i] - tan_tau1_sin_mu[i];
            code_of[i] = (d1_squared < 0.0) & (code_of[i] == OK) ? UNREACHABLE : code_of[i];
        }
        fetch(sec_tau1, ahead);
        fetch(tan_tau1_sin_mu, ahead);
        EACH_ROW c1_of[i] = atan2(c1_of[i], c2_of[i]);
        fetch(tan_tau1, ahead);
        fetch(sin_mu_sec_tau1, ahead);
        EACH_ROW c3_of[i] = asin(c3_of[i]);
        fetch(azimuth_reference, ahead);
        fetch(elevation_reference, ahead);
        EACH_ROW theta_of[i] = asin(theta_of[i]);
        fetch(axis1_min, ahead);
        fetch(axis1_max, ahead);
        fetch(axis2_min, ahead);
        fetch(axis2_max, ahead);
        EACH_ROW
        {
            const double azimuth_i = wrapped(c1_of[i] + azimuth_reference[i]);
            const double elevation_i = c3_of[i] + elevation_reference[i];
            const int outside = (azimuth_i < axis1_min[i]) | (azimuth_i > axis1_max[i])
                              | (elevation_i < axis2_min[i]) | (elevation_i > axis2_max[i]);
            const double code = (code_of[i] == OK) & outside ? OUTSIDE_LIMITS : code_of[i];
            azimuth[i] = code == OK ? azimuth_i : NAN;
            elevation[i] = code == OK ? elevation_i : NAN;
            incidence[i] = code == OK ? theta_of[i] : NAN;
            code_of[i] = code;
        }
        if (far) {
            stream(f->azimuth + first, azimuth, n);
            stream(f->elevation + first, elevation, n);
            stream(f->incidence + first, incidence, n);
        }
        EACH_ROW status[i] = (uint8_t)(int)code_of[i];
    }
    /* streamed answers are in place when this returns */
    _mm_sfence();
}

typedef void kernel(const struct field *, struct sun, size_t, size_t);

static void track_field(kernel *track, const struct field *f, struct sun sun, int threads)
{
#ifdef _OPENMP
    if (threads > 1) {
#pragma omp parallel num_threads(threads)
        {
            const size_t share = (f->n / (size_t)threads + 63) / 64 * 64;
            const size_t start = share * (size_t)omp_get_thread_num();
            const size_t end = start + share < f->n ? start + share : f->n;
            if (start < end)
                track(f, sun, start, end);
        }
        return;
    }
#endif
    (void)threads;
    track(f, sun, 0, f->n);
}

static void fail(const char *what, const char *which)
{
    fprintf(stderr, "c_reduced: %s: %s\n", what, which);
    exit(2);
}

/* Columns on huge pages where the system has them, each starting some lines further into its page:
 * twenty columns at the same place of a page would compete for the same few lines of the caches.
 * Kept until the process ends. */
static void *column_of(size_t bytes)
{
    static size_t stagger;
    const size_t huge = (size_t)1 << 21, total = (bytes + (1 << 16) + huge - 1) / huge * huge;
    void *memory = NULL;
    if (posix_memalign(&memory, huge, total) != 0)
        fail("out of memory", "columns");
#ifdef MADV_HUGEPAGE
    madvise(memory, total, MADV_HUGEPAGE);
#endif
    memset(memory, 0, total);
    stagger += 5 * 64;
    return (char *)memory + stagger % (1 << 15);
}

static double number_after(const char *text, const char *key)
{
    const char *at = strstr(text, key);
    if (at == NULL || (at = strchr(at, ':')) == NULL)
        fail("sidecar lacks", key);
    return strtod(at + 1, NULL);
}

static struct sun read_sun(const char *input, size_t *n)
{
    char path[4096], text[4096];
    const char *dot = strrchr(input, '.');
    if (dot == NULL || snprintf(path, sizeof path, "%.*s.json", (int)(dot - input), input) >= (int)sizeof path)
        fail("cannot name the sidecar of", input);
    FILE *file = fopen(path, "r");
    if (file == NULL)
        fail("cannot open", path);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    *n = (size_t)number_after(text, "\"n\"");
    const double azimuth = number_after(text, "\"sun_azimuth_rad\"");
    const double elevation = number_after(text, "\"sun_elevation_rad\"");
    return (struct sun){cos(elevation) * sin(azimuth), cos(elevation) * cos(azimuth), sin(elevation)};
}

/* With the elevation by arcsine the two constants of (22) carry 1/cos(mu) too. */
static struct field read_field(const char *input, size_t n, int by_arcsine)
{
    double *in[INPUT_COLUMNS];
    FILE *file = fopen(input, "rb");
    if (file == NULL)
        fail("cannot open", input);
    for (int c = 0; c < INPUT_COLUMNS; c++) {
        in[c] = column_of(n * sizeof(double));
        if (fread(in[c], sizeof(double), n, file) != n)
            fail("too short", input);
    }
    fclose(file);
    struct field f = {.n = n};
    double **columns[] = {&f.target_east, &f.target_north, &f.target_up, &f.two_slants, &f.tilt_north, &f.tilt_east,
                          &f.tilt_w, &f.sec_tau1, &f.tan_tau1_sin_mu, &f.tan_tau1, &f.sin_mu_sec_tau1,
                          &f.azimuth, &f.elevation, &f.incidence};
    for (size_t c = 0; c < sizeof columns / sizeof *columns; c++)
        *columns[c] = column_of(n * sizeof(double));
    f.status = column_of(n);
    f.azimuth_reference = in[AZIMUTH_REFERENCE];
    f.elevation_reference = in[ELEVATION_REFERENCE];
    f.axis1_min = in[AXIS1_MIN];
    f.axis1_max = in[AXIS1_MAX];
    f.axis2_min = in[AXIS2_MIN];
    f.axis2_max = in[AXIS2_MAX];
    for (size_t i = 0; i < n; i++) {
        const double east = in[EAST][i], north = in[NORTH][i], up = in[UP][i];
        const double slant = sqrt(east * east + north * north + up * up);
        const double tau1 = in[NONORTHOGONALITY][i], mu = in[MIRROR_TILT][i];
        const double scale = by_arcsine ? 1.0 / cos(mu) : 1.0;
        f.target_east[i] = east / slant;
        f.target_north[i] = north / slant;
        f.target_up[i] = up / slant;
        f.two_slants[i] = 2.0 * slant / in[MIRROR_OFFSET][i];
        f.tilt_north[i] = sin(in[TILT][i]) * cos(in[TILT_AZIMUTH][i]);
        f.tilt_east[i] = sin(in[TILT][i]) * sin(in[TILT_AZIMUTH][i]);
        f.tilt_w[i] = 1.0 / (1.0 + cos(in[TILT][i]));
        f.sec_tau1[i] = scale / cos(tau1);
        f.tan_tau1_sin_mu[i] = tan(tau1) * sin(mu) * scale;
        f.tan_tau1[i] = tan(tau1);
        f.sin_mu_sec_tau1[i] = sin(mu) / cos(tau1);
        const double reference = fmod(f.azimuth_reference[i], TWO_PI);
        f.azimuth_reference[i] = reference < 0.0 ? reference + TWO_PI : reference;
    }
    return f;
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double time_loops(long loops, kernel *track, const struct field *f, struct sun sun, int threads)
{
    const double start = now();
    for (long loop = 0; loop < loops; loop++)
        track_field(track, f, sun, threads);
    return now() - start;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int argc, char **argv)
{
    const char *input = NULL, *output = NULL, *variant = "split";
    int threads = 1, repeat = 11;
    for (int i = 1; i + 1 < argc; i += 2) {
        if (strcmp(argv[i], "--input") == 0)
            input = argv[i + 1];
        else if (strcmp(argv[i], "--output") == 0)
            output = argv[i + 1];
        else if (strcmp(argv[i], "--variant") == 0)
            variant = argv[i + 1];
        else if (strcmp(argv[i], "--threads") == 0)
            threads = atoi(argv[i + 1]);
        else if (strcmp(argv[i], "--repeat") == 0)
            repeat = atoi(argv[i + 1]);
        else
            fail("unknown option", argv[i]);
    }
    if (input == NULL || threads < 1 || repeat < 1)
        fail("usage", "--input FILE [--threads T] [--repeat R] [--output ANSWERS.bin] [--variant NAME]");
    kernel *track = NULL;
    if (strcmp(variant, "loop") == 0)
        track = track_loop;
    else if (strcmp(variant, "split") == 0)
        track = track_split;
    else
        fail("unknown variant", variant);

    size_t n = 0;
    const struct sun sun = read_sun(input, &n);
    const struct field f = read_field(input, n, track == track_split);
    track_field(track, &f, sun, threads);
    if (output != NULL) {
        FILE *file = fopen(output, "wb");
        if (file == NULL)
            fail("cannot write", output);
        fwrite(f.azimuth, sizeof(double), n, file);
        fwrite(f.elevation, sizeof(double), n, file);
        fwrite(f.incidence, sizeof(double), n, file);
        fwrite(f.status, 1, n, file);
        if (fclose(file) != 0)
            fail("cannot write", output);
    }

    long loops = 1;
    double elapsed;
    while ((elapsed = time_loops(loops, track, &f, sun, threads)) < MIN_REPEAT_S)
        loops *= 2;
    double *seconds = column_of((size_t)repeat * sizeof(double));
    for (int r = 0; r < repeat; r++)
        seconds[r] = time_loops(loops, track, &f, sun, threads) / (double)loops;
    qsort(seconds, (size_t)repeat, sizeof(double), ascending);
    const double median = 0.5 * (seconds[(repeat - 1) / 2] + seconds[repeat / 2]);
    printf("{\"peer\": \"c_reduced_%s\", \"version\": \"%s\", \"n\": %zu, \"threads\": %d, "
           "\"ns_per_heliostat\": {\"minimum\": %.6g, \"median\": %.6g}}\n",
           variant, __VERSION__, n, threads, seconds[0] / (double)n * 1e9, median / (double)n * 1e9);
    return 0;
}
