//! Tests as trials: one per test and family of variants, named `kernel::test::family`, so that one family's failure does not hide
//! the others', and what a device cannot run shows as ignored with the reason.
//!
//! The program that runs them (libtest-mimic) takes the arguments of cargo's own test harness and speaks cargo-nextest's listing
//! protocol. Nothing is done while trials are listed: the device is opened by the first that runs.

use libtest_mimic::{Completion, Trial};
use omnix_kernels::Gpu;

use crate::family::Family;

/// Trials of one kernel; made by [`trials!`](macro@crate::trials).
#[derive(Debug)]
pub struct Trials {
    kernel: &'static str,
    list: Vec<Trial>,
}

impl Trials {
    /// None yet.
    #[must_use]
    pub fn of(kernel: &'static str) -> Self {
        Self { kernel, list: Vec::new() }
    }

    /// Once; the test knows which device it wants, if any.
    pub fn once(&mut self, name: &str, test: fn()) {
        let name = format!("{}::{name}", self.kernel);
        self.list.push(Trial::test(name, move || {
            test();
            Ok(())
        }));
    }

    /// With every tier of variants ([`Family::TIERS`]).
    pub fn tiers(&mut self, name: &str, test: fn(&Gpu)) {
        self.each(Family::TIERS, name, test);
    }

    /// With every family ([`Family::FAMILIES`]).
    pub fn families(&mut self, name: &str, test: fn(&Gpu)) {
        self.each(Family::FAMILIES, name, test);
    }

    /// With every family that products have ([`Family::PRODUCTS`]).
    pub fn products(&mut self, name: &str, test: fn(&Gpu)) {
        self.each(Family::PRODUCTS, name, test);
    }

    /// With the software device's variants alone.
    pub fn software(&mut self, name: &str, test: fn(&Gpu)) {
        self.each(&[Family::Software], name, test);
    }

    /// With the variants that round operands to f16.
    pub fn half(&mut self, name: &str, test: fn(&Gpu)) {
        self.each(&[Family::Half, Family::Cooperative], name, test);
    }

    /// With the device's own variants, for kernels that have one text for all devices.
    pub fn device(&mut self, name: &str, test: fn(&Gpu)) {
        self.each(&[Family::Device, Family::StrictBaseline], name, test);
    }

    /// With the variants that stand in for cooperative matrices: f32 beside `Subgroup`, f16 beside `Half`.
    pub fn stand_ins(&mut self, name: &str, test: fn(&Gpu)) {
        self.each(&[Family::Subgroup, Family::Half], name, test);
    }

    fn each(&mut self, families: &'static [Family], name: &str, test: fn(&Gpu)) {
        for family in families {
            let name = format!("{}::{name}::{}", self.kernel, family.name());
            self.list.push(Trial::ignorable_test(name, move || match family.device() {
                Ok(gpu) => {
                    test(&gpu);
                    Ok(Completion::Completed)
                }
                Err(reason) => Ok(Completion::ignored_with(reason)),
            }));
        }
    }
}

impl From<Trials> for Vec<Trial> {
    fn from(trials: Trials) -> Self {
        trials.list
    }
}

/// The trials of a kernel: `trials!("softmax", tiers: [test, ..], once: [test, ..])`. The words are the methods of [`Trials`].
/// A test that is in no list is dead code, which the compiler reports.
#[macro_export]
macro_rules! trials {
    ($kernel:literal $(, $group:ident: [$($test:ident),* $(,)?])* $(,)?) => {{
        let mut trials = $crate::Trials::of($kernel);
        $($(trials.$group(stringify!($test), $test);)*)*
        Vec::<$crate::Trial>::from(trials)
    }};
}

/// Runs all trials with the process's arguments.
#[must_use]
pub fn run(trials: Vec<Trial>) -> std::process::ExitCode {
    libtest_mimic::run(&libtest_mimic::Arguments::from_args(), trials).exit_code()
}
