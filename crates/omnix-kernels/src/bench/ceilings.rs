//! What the processors of this machine can do at most, measured in the same run as the kernels.
//!
//! - Arithmetic: every thread runs 12 independent chains of fused multiply-adds in registers, 8 f32 wide with AVX2 and
//!   FMA where the processor has them, else what the compiler makes of the same loop.
//! - Memory: every thread copies its own 64 MiB; bytes read and bytes written both count.
//!
//! The best of several short runs counts, by processor time where the system tells it (Linux) and by wall time elsewhere:
//! a ceiling is what the machine does when nothing else disturbs it.

use std::hint::black_box;
use std::time::Instant;

use super::clock::{processors, thread_seconds};

/// Ceilings of the host's processors. They bound software devices; a GPU has its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ceilings {
    /// Operations a second, a multiply-add counted as two.
    pub flops: f64,
    /// Bytes a second that a copy reads and writes.
    pub copy: f64,
    /// Threads used: one per processor.
    pub threads: usize,
    /// How the arithmetic was done: "AVX2 + FMA" or "portable".
    pub method: &'static str,
}

const CHAINS: usize = 12;
const LANES: usize = 8;
/// About a tenth of a second, far above the resolution of processor time.
const STEPS: usize = 40_000_000;
const COPY_BYTES: usize = 64 << 20;
const COPIES: usize = 8;
const TRIES: usize = 5;

impl Ceilings {
    /// Measures for one or two seconds on all processors.
    #[must_use]
    pub fn measure() -> Self {
        let threads = processors();
        let chains = detect();
        let mut seconds = f64::INFINITY;
        for _ in 0..TRIES {
            seconds = seconds.min(on_all(threads, &|| (), &|()| {
                black_box(chains.run(black_box(STEPS)));
            }));
        }
        let flops = (2 * CHAINS * LANES * STEPS * threads) as f64 / seconds;
        let mut copy = f64::INFINITY;
        let buffers = || (vec![1u8; COPY_BYTES], vec![2u8; COPY_BYTES]);
        for _ in 0..TRIES {
            copy = copy.min(on_all(threads, &buffers, &|(from, mut to): (Vec<u8>, Vec<u8>)| {
                for _ in 0..COPIES {
                    to.copy_from_slice(black_box(&from));
                    black_box(&to);
                }
            }));
        }
        Self { flops, copy: (2 * COPY_BYTES * COPIES * threads) as f64 / copy, threads, method: chains.name() }
    }
}

/// Seconds that `threads` threads, started together, take for `work`, the slowest counting; `prepare` does not count.
fn on_all<T>(threads: usize, prepare: &(dyn Fn() -> T + Sync), work: &(dyn Fn(T) + Sync)) -> f64 {
    let barrier = std::sync::Barrier::new(threads);
    let one = || {
        let input = prepare();
        barrier.wait();
        let (start, cpu) = (Instant::now(), thread_seconds());
        work(input);
        let wall = start.elapsed().as_secs_f64();
        cpu.zip(thread_seconds()).map_or(wall, |(before, after)| after - before)
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(one)).collect();
        workers.into_iter().map(|w| w.join().unwrap_or(f64::INFINITY)).fold(0.0, f64::max)
    })
}

#[derive(Clone, Copy)]
enum Chains {
    #[cfg(target_arch = "x86_64")]
    Avx2,
    Portable,
}

fn detect() -> Chains {
    #[cfg(target_arch = "x86_64")]
    if std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma") {
        return Chains::Avx2;
    }
    Chains::Portable
}

impl Chains {
    fn name(self) -> &'static str {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "AVX2 + FMA",
            Self::Portable => "portable",
        }
    }

    fn run(self, steps: usize) -> f32 {
        match self {
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "calling a function compiled for features found at run time")]
            // SAFETY: `detect` returns this variant only after finding AVX2 and FMA.
            Self::Avx2 => unsafe { avx2(steps) },
            Self::Portable => portable(steps),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2(steps: usize) -> f32 {
    use std::arch::x86_64::{_mm256_cvtss_f32, _mm256_fmadd_ps, _mm256_set1_ps};
    let (scale, offset) = (_mm256_set1_ps(black_box(0.999_9)), _mm256_set1_ps(black_box(1e-4)));
    let mut sums = [_mm256_set1_ps(1.0); CHAINS];
    for _ in 0..steps {
        // An unrolled body keeps every sum in a register.
        let [a, b, c, d, e, f, g, h, i, j, k, l] = sums;
        let next = |v| _mm256_fmadd_ps(v, scale, offset);
        sums = [
            next(a),
            next(b),
            next(c),
            next(d),
            next(e),
            next(f),
            next(g),
            next(h),
            next(i),
            next(j),
            next(k),
            next(l),
        ];
    }
    sums.iter().map(|v| _mm256_cvtss_f32(*v)).sum()
}

fn portable(steps: usize) -> f32 {
    let (scale, offset) = (black_box(0.999_9f32), black_box(1e-4f32));
    let mut sums = [[1.0f32; LANES]; CHAINS];
    for _ in 0..steps {
        for chain in &mut sums {
            for lane in chain {
                *lane = *lane * scale + offset;
            }
        }
    }
    sums.iter().flatten().sum()
}
