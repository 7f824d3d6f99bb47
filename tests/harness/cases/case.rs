//! A call of a kernel with its inputs, its oracle and its work.

use std::fmt::Debug;

use omnix_kernels::readback::read;
use omnix_kernels::run::{HostArg, execute, upload};
use omnix_kernels::{Arg, Caps, Dispatch, Gpu, KernelError};

use crate::compare::relative_error;
use crate::family::family;

/// What a case is measured by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Operations, compared with the arithmetic ceiling.
    Flops(u64),
    /// Bytes read and written, compared with the copy ceiling.
    Bytes(u64),
}

impl Work {
    /// Operations or bytes.
    #[must_use]
    pub fn amount(self) -> u64 {
        match self {
            Self::Flops(amount) | Self::Bytes(amount) => amount,
        }
    }
}

/// An argument or result of a kernel on the host.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Numbers.
    F32(Vec<f32>),
    /// Indices.
    U32(Vec<u32>),
    /// Packed weights.
    Bytes(Vec<u8>),
    /// An output or scratch of this number of 32-bit words, or what stands for an absent argument.
    Out(usize),
}

impl Values {
    /// As the one-call runner takes it.
    #[must_use]
    pub fn arg(&self) -> HostArg<'_> {
        match self {
            Self::F32(values) => HostArg::F32(values),
            Self::U32(values) => HostArg::U32(values),
            Self::Bytes(bytes) => HostArg::Bytes(bytes),
            Self::Out(words) => HostArg::Out(*words),
        }
    }

    /// The numbers; none where it is something else.
    #[must_use]
    pub fn f32(&self) -> &[f32] {
        if let Self::F32(values) = self { values } else { &[] }
    }

    /// The indices; none where it is something else.
    #[must_use]
    pub fn u32(&self) -> &[u32] {
        if let Self::U32(values) = self { values } else { &[] }
    }
}

/// What a kernel's specification adds to be a case. Inputs depend on the specification alone, and on `caps` where a variant's
/// operands are f16: then they are numbers that f16 holds.
pub trait Call: Debug {
    /// The kernel's name.
    fn kernel(&self) -> &'static str;
    /// Its dispatches.
    ///
    /// # Errors
    /// As the kernel's own `record`.
    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError>;
    /// All arguments in the kernel's order.
    fn args(&self, caps: &Caps) -> Vec<Values>;
    /// The results that the oracle computes from [`Call::args`]: f32 within [`Call::limit`], indices exactly.
    fn oracle(&self, caps: &Caps, args: &[Values]) -> Vec<(Arg, Values)>;
    /// Relative error in norm that the device may have in a result; 0 where the bits must agree.
    fn limit(&self, caps: &Caps, arg: Arg) -> f64;
    /// What it is measured by.
    fn work(&self) -> Work;
}

/// A call whose dispatches are changed before they run.
#[derive(Clone, Copy)]
pub struct Changed<C, F> {
    /// The call.
    pub call: C,
    /// Sees every dispatch.
    pub change: F,
    /// In place of the call's own.
    pub limit: f64,
}

impl<C: Debug, F> Debug for Changed<C, F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "changed {:?}", self.call)
    }
}

impl<C: Call, F: Fn(&mut Dispatch)> Call for Changed<C, F> {
    fn kernel(&self) -> &'static str {
        self.call.kernel()
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let mut dispatches = self.call.record(caps)?;
        dispatches.iter_mut().for_each(&self.change);
        Ok(dispatches)
    }

    fn args(&self, caps: &Caps) -> Vec<Values> {
        self.call.args(caps)
    }

    fn oracle(&self, caps: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        self.call.oracle(caps, args)
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        self.limit
    }

    fn work(&self) -> Work {
        self.call.work()
    }
}

/// A named call.
#[derive(Debug)]
pub struct Case {
    /// Unique among the cases of a kernel.
    pub name: String,
    /// A shape that networks have: for benches. The others are for tests, whose oracles are slow.
    pub bench: bool,
    /// The specification.
    pub call: Box<dyn Call>,
}

impl Case {
    /// A case of the test.
    #[must_use]
    pub fn test(call: impl Call + 'static) -> Self {
        Self { name: format!("{call:?}"), bench: false, call: Box::new(call) }
    }

    /// A case of the bench.
    #[must_use]
    pub fn bench(name: impl Into<String>, call: impl Call + 'static) -> Self {
        Self { name: name.into(), bench: true, call: Box::new(call) }
    }
}

/// What the device makes of `args`: the arguments `wanted`, as 32-bit words.
///
/// # Panics
/// When it cannot be recorded or run.
#[must_use]
pub fn results(gpu: &Gpu, call: &dyn Call, args: &[Values], wanted: &[Arg]) -> Vec<Vec<u32>> {
    let host: Vec<HostArg<'_>> = args.iter().map(Values::arg).collect();
    let slices = upload(gpu, &host).expect("uploads");
    execute(gpu, &call.record(&gpu.caps).expect("records"), &slices).expect("runs");
    wanted.iter().map(|arg| read(gpu, &slices[usize::from(arg.0)]).expect("reads")).collect()
}

/// What the device makes of a call's own arguments: its result `arg`.
///
/// # Panics
/// When it cannot be recorded or run.
#[must_use]
pub fn computed(gpu: &Gpu, call: &dyn Call, arg: Arg) -> Vec<f32> {
    computed_from(gpu, call, &call.args(&gpu.caps), arg)
}

/// What the device makes of other arguments.
///
/// # Panics
/// When it cannot be recorded or run.
#[must_use]
pub fn computed_from(gpu: &Gpu, call: &dyn Call, args: &[Values], arg: Arg) -> Vec<f32> {
    bytemuck::pod_collect_to_vec(&results(gpu, call, args, &[arg])[0])
}

/// Compares every case of the test with the oracle and goes on after a failure; then fails with all of them.
///
/// # Panics
/// If any case differs, or the list is empty.
pub fn check_all(gpu: &Gpu, cases: impl IntoIterator<Item = Case>) {
    let (mut count, mut failed) = (0, Vec::new());
    for case in cases.into_iter().filter(|case| !case.bench) {
        count += 1;
        if let Err(what) = check(gpu, case.call.as_ref()) {
            failed.push(format!("{} {}: {what}", family(gpu), case.name));
        }
    }
    assert!(count > 0, "no case");
    assert!(failed.is_empty(), "{} of {count} cases differ:\n{}", failed.len(), failed.join("\n"));
}

fn check(gpu: &Gpu, call: &dyn Call) -> Result<(), String> {
    let args = call.args(&gpu.caps);
    let (wanted, oracle): (Vec<Arg>, Vec<Values>) = call.oracle(&gpu.caps, &args).into_iter().unzip();
    for ((got, want), arg) in results(gpu, call, &args, &wanted).iter().zip(&oracle).zip(&wanted) {
        match want {
            Values::F32(want) => {
                let limit = call.limit(&gpu.caps, *arg);
                let got: &[f32] = bytemuck::cast_slice(got);
                let error = if limit > 0.0 { relative_error(got, want) } else { f64::from(u8::from(got != want)) };
                if error > limit {
                    return Err(format!("argument {}: relative error {error:.3e} > {limit:.1e}", arg.0));
                }
            }
            Values::U32(want) if got == want => {}
            Values::U32(want) => {
                let at = got.iter().zip(want).position(|(got, want)| got != want);
                return Err(format!("argument {}: first difference at {at:?}", arg.0));
            }
            other => return Err(format!("an oracle gives numbers or indices, not {other:?}")),
        }
    }
    Ok(())
}
