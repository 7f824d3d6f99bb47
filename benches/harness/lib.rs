//! Shared bench harness: the device, the command line, and a Markdown table of cases against the machine's ceilings.
//!
//! `cargo bench -p omnix-benches --bench kernels [-- [--test] [--tier software|baseline|gpu] [--experimental] [FILTER]]`;
//! `--test` runs the smallest case of each kernel once, to see that the benches work (CI does so);
//! `--experimental` uses cooperative matrices where the device has them, a filter keeps the cases whose "kernel case" contains
//! it. `OMNIX_DEVICE` picks the device.
//!
//! `--serve` is for tools/compare, which measures several programs in turn: every line of standard input is a filter, and
//! its cases are measured once (one run of a tenth of a second) and answered by one JSON object per case and an empty line.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{BufRead as _, Write as _};

use omnix_kernels::bench::{Ceilings, Effort, time};
use omnix_kernels::run::{HostArg, upload};
use omnix_kernels::{Dispatch, Gpu, KernelError, Tier, adapter};
use omnix_tests::cases::{Case, Values, Work};
use serde_json::json;

/// The command line.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Run the smallest case of each kernel once, without measuring the ceilings.
    pub test: bool,
    /// Take filters from standard input, answer in JSON.
    pub serve: bool,
    /// Cooperative matrices, where the device has them.
    pub experimental: bool,
    /// Another family of variants than the device's own.
    pub tier: Option<Tier>,
    /// A part of "kernel case".
    pub filter: Option<String>,
}

impl Options {
    /// Reads the process's arguments.
    ///
    /// # Errors
    /// A message that names an argument this does not know.
    pub fn from_args() -> Result<Self, String> {
        let mut options = Self::default();
        let mut args = std::env::args().skip(1);
        while let Some(arg) = args.next() {
            match arg.as_str() {
                "--test" => options.test = true,
                "--serve" => options.serve = true,
                "--experimental" => options.experimental = true,
                // Cargo adds it.
                "--bench" => {}
                "--tier" => {
                    options.tier = Some(match args.next().as_deref() {
                        Some("software") => Tier::Software,
                        Some("baseline") => Tier::Baseline,
                        Some("gpu") => Tier::Gpu,
                        other => return Err(format!("--tier takes software, baseline or gpu, not {other:?}")),
                    });
                }
                filter if !filter.starts_with('-') => options.filter = Some(filter.to_owned()),
                other => {
                    return Err(format!(
                        "unknown argument {other}; there are --test, --serve, --experimental, --tier TIER and a filter"
                    ));
                }
            }
        }
        Ok(options)
    }
}

/// A running table.
#[derive(Debug)]
pub struct Bench {
    /// The device, with the variants asked for.
    pub gpu: Gpu,
    options: Options,
    ceilings: Option<Ceilings>,
    choice: Choice,
}

/// Which cases run.
#[derive(Debug)]
enum Choice {
    /// All that the filter keeps.
    All,
    /// None yet: the smallest case of each kernel, and its work, is being found out.
    Survey(RefCell<BTreeMap<String, (u64, String)>>),
    /// This one of each kernel.
    Smallest(BTreeMap<String, (u64, String)>),
}

impl Bench {
    /// Opens the device, measures the ceilings and prints the head of the table.
    ///
    /// # Errors
    /// When there is no usable device.
    pub fn new(options: Options) -> Result<Self, KernelError> {
        let adapter = adapter::choose(std::env::var("OMNIX_DEVICE").ok().as_deref())?;
        let (device, queue, products) = adapter::open_experimental(&adapter)?;
        let mut gpu = Gpu::new(&device, &queue);
        if options.experimental {
            gpu = gpu.with_caps(gpu.caps.clone().with_cooperative(products));
        }
        if let Some(tier) = options.tier {
            gpu = gpu.with_caps(gpu.caps.clone().with_tier(tier));
        }
        let info = adapter.get_info();
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let ceilings = (software && !options.test).then(Ceilings::measure);
        if options.serve {
            let (flops, copy) = (ceilings.map(|c| c.flops), ceilings.map(|c| c.copy));
            let driver = format!("{} ({})", info.name, info.driver_info);
            say(&json!({ "device": driver, "tier": gpu.caps.tier.to_string(), "flops": flops, "copy": copy })
                .to_string());
            return Ok(Self { gpu, options, ceilings, choice: Choice::All });
        }
        say(&format!("{} ({}), {} variants\n", info.name, info.driver_info, gpu.caps.tier));
        if let Some(c) = &ceilings {
            say(&format!(
                "Ceilings, best of 5 by processor time, {} threads: {:.0} GFLOP/s ({}), copy {:.1} GB/s (read + written).\n\
                 Rates are medians of 5 runs; \"quiet\" is by processor time / threads instead of wall time, what an idle\n\
                 machine would show, and is what the ceiling is compared with. \"first\" includes the driver's compilation.\n",
                c.threads,
                c.flops / 1e9,
                c.method,
                c.copy / 1e9
            ));
        }
        say("| kernel | case | ms | rate | quiet | of ceiling | first ms |");
        say("|---|---|---|---|---|---|---|");
        Ok(Self { gpu, options, ceilings, choice: Choice::All })
    }

    /// Measures the cases of a kernel that networks have and the filter keeps. Those that are not for this device are left out.
    ///
    /// # Errors
    /// When one cannot be recorded or run.
    pub fn cases(&self, cases: Vec<Case>) -> Result<(), KernelError> {
        for case in cases.iter().filter(|case| case.bench) {
            let (kernel, call) = (case.call.kernel(), &case.call);
            if !self.wants(kernel, &case.name) {
                continue;
            }
            let dispatches = match call.record(&self.gpu.caps) {
                // It is for software devices alone.
                Err(KernelError::Unsupported { kernel: "winograd", .. }) => continue,
                recorded => recorded?,
            };
            let work = call.work();
            if let Choice::Survey(smallest) = &self.choice {
                let mut smallest = smallest.borrow_mut();
                let found = smallest.entry(kernel.to_owned()).or_insert_with(|| (work.amount(), case.name.clone()));
                if work.amount() < found.0 {
                    *found = (work.amount(), case.name.clone());
                }
                continue;
            }
            let args = call.args(&self.gpu.caps);
            let args: Vec<HostArg<'_>> = args.iter().map(Values::arg).collect();
            self.case(kernel, &case.name, work, &dispatches, &args)?;
        }
        Ok(())
    }

    /// Whether the filter keeps any case of this name, so that its inputs need not be made otherwise.
    fn wants(&self, kernel: &str, case: &str) -> bool {
        self.options.filter.as_ref().is_none_or(|filter| format!("{kernel} {case}").contains(filter.as_str()))
            && match &self.choice {
                Choice::All | Choice::Survey(_) => true,
                Choice::Smallest(smallest) => smallest.get(kernel).is_some_and(|(_, name)| name == case),
            }
    }

    /// Measures one case and prints its line.
    fn case(
        &self,
        kernel: &str,
        case: &str,
        work: Work,
        dispatches: &[Dispatch],
        args: &[HostArg<'_>],
    ) -> Result<(), KernelError> {
        let args = upload(&self.gpu, args)?;
        let effort = match &self.options {
            options if options.test => Effort::ONCE,
            options if options.serve => Effort { runs: 1, ..Effort::TABLE },
            _ => Effort::TABLE,
        };
        let timing = time(&self.gpu, dispatches, &args, effort)?;
        if self.options.serve {
            let (flops, bytes) = match work {
                Work::Flops(n) => (Some(n), None),
                Work::Bytes(n) => (None, Some(n)),
            };
            let (wall, quiet, first) = (timing.wall, timing.cpu, timing.first);
            say(&json!({
                "name": format!("{kernel} {case}"), "wall": wall, "quiet": quiet, "first": first, "flops": flops, "bytes": bytes,
            })
            .to_string());
            return Ok(());
        }
        let (amount, unit, ceiling) = match work {
            Work::Flops(n) => (n as f64, "GFLOP/s", self.ceilings.map(|c| c.flops)),
            Work::Bytes(n) => (n as f64, "GB/s", self.ceilings.map(|c| c.copy)),
        };
        let rate = |seconds: f64| format!("{:.1} {unit}", amount / seconds / 1e9);
        let part = |seconds: f64| ceiling.map_or("-".to_owned(), |c| format!("{:.0} %", 100.0 * amount / seconds / c));
        // Processor time says something about a device that runs on the processor.
        let quiet = timing.cpu.filter(|_| self.ceilings.is_some());
        say(&format!(
            "| {kernel} | {case} | {:.2} | {} | {} | {} | {:.0} |",
            timing.wall * 1e3,
            rate(timing.wall),
            quiet.map_or("-".to_owned(), rate),
            part(quiet.unwrap_or(timing.wall)),
            timing.first * 1e3,
        ));
        Ok(())
    }
}

impl Bench {
    /// Runs `cases` with the filter of the command line, or with every line of standard input as filter (`--serve`).
    /// For `--test` they are gone through twice, and the smallest of each kernel runs.
    ///
    /// # Errors
    /// As `cases`.
    pub fn run(&mut self, cases: &dyn Fn(&Self) -> Result<(), KernelError>) -> Result<(), KernelError> {
        if self.options.test {
            self.choice = Choice::Survey(RefCell::default());
            cases(self)?;
            if let Choice::Survey(smallest) = std::mem::replace(&mut self.choice, Choice::All) {
                self.choice = Choice::Smallest(smallest.into_inner());
            }
        }
        if !self.options.serve {
            return cases(self);
        }
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            self.options.filter = Some(line);
            cases(self)?;
            say("");
        }
        Ok(())
    }
}

/// `len` numbers in -1..1, the same on every machine.
#[must_use]
pub fn numbers(len: usize) -> Vec<f32> {
    let mut state = 1u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1u32 << 23) as f32 - 1.0
    };
    (0..len).map(|_| next()).collect()
}

/// A line on standard output. A closed pipe is no reason to fail.
fn say(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}
