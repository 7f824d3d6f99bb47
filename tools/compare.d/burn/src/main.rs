//! burn on the shapes of our kernels, for tools/compare: every line of standard input names a kernel and its numbers
//! (`linear 1296 1152 384`), answered by one line of JSON. Inputs are made and the kernel is run once (burn tunes itself
//! and the driver compiles) the first time a line is seen; every line measures one run of about a tenth of a second.
//!
//! `into_data` is lazy: it returns at once and the work is waited for when the bytes are read. Every measurement here
//! ends with reading a number of the last result, which comes after everything that was submitted before it; the first
//! results are compared with sums made on the processor.

use std::collections::HashMap;
use std::io::{BufRead as _, Write as _};
use std::time::Instant;

use burn::tensor::module::{attention, conv2d, interpolate, layer_norm, linear};
use burn::tensor::ops::{AttentionModuleOptions, ConvOptions, InterpolateMode, InterpolateOptions};
use burn::tensor::{Device, Tensor, TensorData};

/// An operation ready to run, and what its first number should be.
struct Case {
    run: Box<dyn Fn() -> Tensor<1>>,
    first: f64,
    repeats: usize,
}

fn main() {
    let device: Device = burn::backend::wgpu::WgpuDevice::default().into();
    let mut cases: HashMap<String, Case> = HashMap::new();
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        let answer = match cases.get(&line) {
            Some(case) => measure(case),
            None => prepare(&line, &device).and_then(|case| {
                let text = measure(&case);
                cases.insert(line, case);
                text
            }),
        };
        let text = answer.unwrap_or_else(|error| format!("{{\"error\": \"{error}\"}}"));
        println!("{text}");
        let _ = std::io::stdout().flush();
    }
}

/// Numbers from -1 to 1, the same on every machine.
fn numbers(count: usize) -> Vec<f32> {
    let mut state = 1u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1u32 << 23) as f32 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

fn tensor<const D: usize>(values: &[f32], shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), device)
}

/// The first number, which waits for everything before it.
fn first_number(result: Tensor<1>) -> Result<f64, String> {
    let bytes = result.slice([0..1]).into_data();
    Ok(f64::from(bytes.to_vec::<f32>().map_err(|e| format!("{e:?}"))?[0]))
}

fn flat<const D: usize>(result: Tensor<D>) -> Tensor<1> {
    let count = result.shape().num_elements();
    result.reshape([count])
}

/// Makes inputs, runs once, checks the first number, and finds how many runs take a tenth of a second.
fn prepare(line: &str, device: &Device) -> Result<Case, String> {
    let mut words = line.split_whitespace();
    let name = words.next().unwrap_or_default();
    let sizes: Vec<usize> =
        words.map(str::parse).collect::<Result<_, _>>().map_err(|_| format!("{line}: sizes are numbers"))?;
    let mut case = match (name, sizes.as_slice()) {
        ("linear", &[m, n, k]) => {
            let (x, w, b) = (numbers(m * k), numbers(k * n), numbers(n));
            let first = (0..k).map(|i| f64::from(x[i]) * f64::from(w[i * n])).sum::<f64>() + f64::from(b[0]);
            let (x, w, b) = (tensor(&x, [m, k], device), tensor(&w, [k, n], device), tensor(&b, [n], device));
            Case::new(first, move || flat(linear(x.clone(), w.clone(), Some(b.clone()))))
        }
        ("attention", &[heads, width, tokens]) => {
            let values = numbers(heads * tokens * width);
            let first = attention_number(&values, width, tokens);
            let q = tensor(&values, [1, heads, tokens, width], device);
            let (k, v) = (tensor(&values, q.dims(), device), tensor(&values, q.dims(), device));
            let run = move || {
                flat(attention(q.clone(), k.clone(), v.clone(), None, None, AttentionModuleOptions::default()))
            };
            Case::new(first, run)
        }
        ("conv", &[ci, co, h, w]) => {
            let (x, weights, b) = (numbers(ci * h * w), numbers(co * ci * 9), numbers(co));
            // The corner sees the lower right four taps.
            let tap = |c: usize, y: usize, z: usize| {
                f64::from(x[(c * h + y) * w + z]) * f64::from(weights[c * 9 + (y + 1) * 3 + z + 1])
            };
            let first = (0..ci).map(|c| tap(c, 0, 0) + tap(c, 0, 1) + tap(c, 1, 0) + tap(c, 1, 1)).sum::<f64>();
            let (x, weights) = (tensor(&x, [1, ci, h, w], device), tensor(&weights, [co, ci, 3, 3], device));
            let (bias, first) = (tensor(&b, [co], device), first + f64::from(b[0]));
            let options = ConvOptions::new([1, 1], [1, 1], [1, 1], 1);
            Case::new(first, move || flat(conv2d(x.clone(), weights.clone(), Some(bias.clone()), options.clone())))
        }
        ("norm", &[m, c]) => {
            let (x, g) = (numbers(m * c), numbers(c));
            let row: Vec<f64> = x[..c].iter().map(|v| f64::from(*v)).collect();
            let mean = row.iter().sum::<f64>() / c as f64;
            let variance = row.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / c as f64;
            let first = (row[0] - mean) / (variance + 1e-6).sqrt() * f64::from(g[0]) + f64::from(g[0]);
            let (x, g) = (tensor(&x, [m, c], device), tensor(&g, [c], device));
            Case::new(first, move || flat(layer_norm(x.clone(), g.clone(), Some(g.clone()), 1e-6)))
        }
        ("resize", &[frames, c, h, w]) => {
            let x = numbers(frames * c * h * w);
            let first = f64::from(x[0]);
            let x = tensor(&x, [frames, c, h, w], device);
            let options = InterpolateOptions::new(InterpolateMode::Bilinear).with_output_size([2 * h, 2 * w]);
            Case::new(first, move || flat(interpolate(x.clone(), options.clone())))
        }
        ("add", &[count]) => {
            let x = numbers(count);
            let first = 2.0 * f64::from(x[0]);
            let (x, y) = (tensor(&x, [count], device), tensor(&x, [count], device));
            Case::new(first, move || x.clone() + y.clone())
        }
        _ => return Err(format!("unknown: {line}")),
    };
    let got = first_number((case.run)())?;
    if (got - case.first).abs() > 1e-3 * case.first.abs().max(1.0) {
        return Err(format!("{line}: wrong result, {got} for {}", case.first));
    }
    let since = Instant::now();
    first_number((case.run)())?;
    case.repeats = (0.1 / since.elapsed().as_secs_f64()).ceil().clamp(1.0, 1e4) as usize;
    Ok(case)
}

impl Case {
    fn new(first: f64, run: impl Fn() -> Tensor<1> + 'static) -> Self {
        Self { run: Box::new(run), first, repeats: 1 }
    }
}

/// Attention of the first query with equal queries, keys and values: its first channel.
fn attention_number(values: &[f32], width: usize, tokens: usize) -> f64 {
    let row = |t: usize| &values[t * width..(t + 1) * width];
    let dot = |t: usize| row(0).iter().zip(row(t)).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
    let scores: Vec<f64> = (0..tokens).map(|t| dot(t) / (width as f64).sqrt()).collect();
    let most = scores.iter().copied().fold(f64::MIN, f64::max);
    let weights: Vec<f64> = scores.iter().map(|s| (s - most).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().enumerate().map(|(t, w)| w * f64::from(row(t)[0])).sum::<f64>() / sum
}

/// One run, by the wall and by the processors' time over their number.
fn measure(case: &Case) -> Result<String, String> {
    let (since, before) = (Instant::now(), processor_seconds());
    let mut last = None;
    for _ in 0..case.repeats {
        last = Some((case.run)());
    }
    last.map_or(Ok(0.0), first_number)?;
    let repeats = case.repeats as f64;
    let wall = since.elapsed().as_secs_f64() / repeats;
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as f64;
    let quiet = before.zip(processor_seconds()).map(|(a, b)| (b - a) / threads / repeats);
    Ok(format!("{{\"wall\": {wall}, \"quiet\": {}}}", quiet.map_or("null".to_owned(), |q| q.to_string())))
}

/// Processor time of all threads so far, in nanoseconds as the scheduler counts them (Linux).
fn processor_seconds() -> Option<f64> {
    let mut sum = 0u64;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        let Ok(text) = std::fs::read_to_string(task.ok()?.path().join("schedstat")) else { continue };
        sum += text.split_whitespace().next()?.parse::<u64>().ok()?;
    }
    Some(sum as f64 * 1e-9)
}
