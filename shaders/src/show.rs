//! `cargo shader linear/gpu`: the text of a variant as a device gets it, composed. Line numbers in messages of naga and drivers are of this
//! text. `cargo shader linear` lists the variants of a kernel, `cargo shader` all of them.

use std::io::{self, Write as _};
use std::process::ExitCode;

use omnix_shaders::ALL;

fn main() -> ExitCode {
    let wanted = std::env::args().nth(1).unwrap_or_default();
    let (kernel, variant) = wanted.split_once('/').unwrap_or((&wanted, ""));
    let mut out = io::stdout().lock();
    let mut found = false;
    for shader in ALL.iter().filter(|shader| kernel.is_empty() || shader.kernel == kernel) {
        // A reader that has gone away is no reason to fail.
        let _ = match variant {
            "" => writeln!(out, "{}/{}  {}", shader.kernel, shader.variant, shader.requires.join(" ")),
            name if name == shader.variant => write!(out, "{}", shader.wgsl),
            _ => continue,
        };
        found = true;
    }
    if found {
        return ExitCode::SUCCESS;
    }
    let _ = writeln!(io::stderr(), "there is no {wanted}; `cargo shader` lists all kernels and their variants");
    ExitCode::FAILURE
}
