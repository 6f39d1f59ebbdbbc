/* The machine's own bounds, to be read beside the peers' figures: bandwidth of each level of memory
 * [GB/s] and throughput of the arithmetic units [ns per 8 doubles]. Prints one JSON line.
 * With two threads both figures are of the machine as a whole. The copy counts bytes read plus bytes written.
 * Build: cc -O3 -march=native -fopenmp. Usage: machine_limits [--threads T]
 */
#define _DEFAULT_SOURCE
#include <immintrin.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#ifdef __AVX512F__
typedef __m512d vector;
#define ISA "avx512f"
#define LANES 8
#define LOAD _mm512_load_pd
#define STREAM _mm512_stream_pd
#define SET1 _mm512_set1_pd
#define ADD _mm512_add_pd
#define FMA _mm512_fmadd_pd
#define DIVIDE _mm512_div_pd
#define SQRT _mm512_sqrt_pd
#else
typedef __m256d vector;
#define ISA "avx2"
#define LANES 4
#define LOAD _mm256_load_pd
#define STREAM _mm256_stream_pd
#define SET1 _mm256_set1_pd
#define ADD _mm256_add_pd
#define FMA _mm256_fmadd_pd
#define DIVIDE _mm256_div_pd
#define SQRT _mm256_sqrt_pd
#endif

#define ROUNDS 9
#define MIN_ROUND_S 0.05
/* Keeps a value alive, and the compiler from seeing through it. */
#define OPAQUE(value) __asm__ volatile("" : "+v"(value))

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double *doubles(size_t bytes)
{
    void *memory = NULL;
    if (posix_memalign(&memory, (size_t)1 << 21, bytes) != 0)
        exit(2);
#ifdef MADV_HUGEPAGE
    madvise(memory, bytes, MADV_HUGEPAGE);
#endif
    memset(memory, 1, bytes);
    return memory;
}

/* Each of these does `loops` passes over `count` doubles (or `count` operations) on one thread. */
typedef void pass(double *a, double *b, size_t count, long loops);

__attribute__((noinline)) static void read_pass(double *a, double *b, size_t count, long loops)
{
    (void)b;
    vector sums[8];
    for (int j = 0; j < 8; j++)
        sums[j] = SET1(0.0);
    for (long loop = 0; loop < loops; loop++)
        for (size_t i = 0; i < count; i += 8 * LANES)
#pragma GCC unroll 8
            for (int j = 0; j < 8; j++)
                sums[j] = ADD(sums[j], LOAD(a + i + (size_t)j * LANES));
    for (int j = 1; j < 8; j++)
        sums[0] = ADD(sums[0], sums[j]);
    OPAQUE(sums[0]);
}

__attribute__((noinline)) static void copy_pass(double *a, double *b, size_t count, long loops)
{
    for (long loop = 0; loop < loops; loop++)
        for (size_t i = 0; i < count; i += 4 * LANES)
#pragma GCC unroll 4
            for (int j = 0; j < 4; j++)
                STREAM(b + i + (size_t)j * LANES, LOAD(a + i + (size_t)j * LANES));
    _mm_sfence();
}

/* Chains enough to hide the latency of the slowest unit; without -ffast-math none can be shortened. */
#define CHAINS 16
#define ARITHMETIC(NAME, EXPRESSION)                                                              \
    __attribute__((noinline)) static void NAME(double *a, double *b, size_t count, long loops)    \
    {                                                                                             \
        (void)a;                                                                                  \
        (void)b;                                                                                  \
        vector x[CHAINS], y = SET1(1.0000001);                                                    \
        OPAQUE(y);                                                                                \
        _Pragma("GCC unroll 16") for (int j = 0; j < CHAINS; j++)                                 \
            x[j] = SET1(1.5 + j);                                                                 \
        for (long loop = 0; loop < loops; loop++)                                                 \
            for (size_t i = 0; i < count; i += CHAINS * LANES)                                    \
                _Pragma("GCC unroll 16") for (int j = 0; j < CHAINS; j++)                         \
                    x[j] = EXPRESSION;                                                            \
        vector sum = x[0];                                                                        \
        _Pragma("GCC unroll 16") for (int j = 1; j < CHAINS; j++)                                 \
            sum = ADD(sum, x[j]);                                                                 \
        OPAQUE(sum);                                                                              \
    }

ARITHMETIC(fma_pass, FMA(x[j], y, y))
ARITHMETIC(divide_pass, DIVIDE(y, x[j]))
ARITHMETIC(sqrt_pass, SQRT(x[j]))
/* Every unit at work: half multiply-adds, half additions. */
ARITHMETIC(mixed_pass, j % 2 ? ADD(x[j], y) : FMA(x[j], y, y))

/* Best seconds for one pass of every thread over its own `count` doubles. */
static double best(pass *run, size_t count, int threads, int arrays)
{
    double *a[64] = {0}, *b[64] = {0};
    const size_t bytes = (count * sizeof(double) + (1 << 21)) & ~(size_t)((1 << 21) - 1);
    for (int t = 0; t < threads && arrays > 0; t++) {
        a[t] = doubles(bytes);
        b[t] = arrays > 1 ? doubles(bytes) : NULL;
    }
    double least = 1e9;
    long loops = 1;
    for (int round = 0; round < ROUNDS;) {
        const double start = now();
#ifdef _OPENMP
#pragma omp parallel num_threads(threads)
        run(a[omp_get_thread_num()], b[omp_get_thread_num()], count, loops);
#else
        run(a[0], b[0], count, loops);
#endif
        const double elapsed = now() - start;
        if (elapsed < MIN_ROUND_S) {
            loops *= 2;
            continue;
        }
        least = elapsed / (double)loops < least ? elapsed / (double)loops : least;
        round++;
    }
    for (int t = 0; t < threads; t++) {
        free(a[t]);
        free(b[t]);
    }
    return least;
}

int main(int argc, char **argv)
{
    int threads = 1;
    for (int i = 1; i + 1 < argc; i += 2)
        if (strcmp(argv[i], "--threads") == 0)
            threads = atoi(argv[i + 1]);
    if (threads < 1 || threads > 64)
        return 2;
    /* bytes on each thread: well inside L1, L2 and L3, and well beyond */
    static const struct {
        const char *name;
        size_t bytes;
    } levels[] = {{"l1", 24u << 10}, {"l2", 512u << 10}, {"l3", 8u << 20}, {"memory", 256u << 20}};
    printf("{\"isa\": \"%s\", \"threads\": %d, \"read_gb_per_s\": {", ISA, threads);
    for (size_t l = 0; l < sizeof levels / sizeof *levels; l++) {
        const size_t count = levels[l].bytes / sizeof(double);
        const double seconds = best(read_pass, count, threads, 1);
        const double gigabytes = 1e-9 * (double)threads * (double)levels[l].bytes;
        printf("%s\"%s\": %.1f", l ? ", " : "", levels[l].name, gigabytes / seconds);
    }
    const size_t large = 256u << 20, operations = 1u << 16;
    const double copied = 2e-9 * (double)threads * (double)large / best(copy_pass, large / sizeof(double), threads, 2);
    printf("}, \"streaming_copy_gb_per_s\": %.1f, \"ns_per_8_doubles\": {", copied);
    const double eights = (double)threads * (double)operations / 8.0 * 1e-9;
    printf("\"fma\": %.4f, ", best(fma_pass, operations, threads, 0) / eights);
    printf("\"mixed\": %.4f, ", best(mixed_pass, operations, threads, 0) / eights);
    printf("\"divide\": %.3f, ", best(divide_pass, operations, threads, 0) / eights);
    printf("\"sqrt\": %.3f}}\n", best(sqrt_pass, operations, threads, 0) / eights);
    return 0;
}
