//! Windows over tensors of 32-bit words: where they start, what remainder the shader adds, how much fits.

use omnix_shaders::Shader;

use crate::dispatch::Window;
use crate::{Arg, Caps, Tier};

/// A window of `arg` over the words `first..first + len`. It starts at the aligned offset at or below
/// `first`; the second value is the distance in words, which the shader adds.
pub(crate) fn cover(arg: Arg, first: u64, len: u64, caps: &Caps) -> (Window, u32) {
    let offset = first * 4 / caps.align * caps.align;
    let rest = first - offset / 4;
    (arg.window(offset, (rest + len) * 4), rest as u32)
}

/// Words of any one piece of a tensor that a dispatch can surely see, wherever the piece starts.
pub(crate) fn room(caps: &Caps) -> u64 {
    caps.window().saturating_sub(caps.align) / 4
}

/// The variant of a kernel that moves tensors, and the words of its elements: four at a time where everything is a
/// multiple of four (`fours`), as two 64-bit words on a software device.
pub(crate) fn unit(caps: &Caps, fours: bool, [words, vec4, software]: [&'static Shader; 3]) -> (&'static Shader, u32) {
    match caps.tier {
        _ if !fours => (words, 1),
        Tier::Software => (software, 4),
        _ => (vec4, 4),
    }
}

/// Elements of a line that each of eight neighbouring invocations moves: a software device saves divisions, a GPU wants many
/// invocations.
pub(crate) fn steps(caps: &Caps, line: u32) -> u32 {
    line.div_ceil(8).clamp(1, if caps.tier == Tier::Software { 64 } else { 8 })
}

#[cfg(test)]
mod tests {
    use super::{cover, room};
    use crate::{Arg, Caps};

    #[test]
    fn windows_start_aligned_and_fit() {
        let caps = Caps { max_binding: 1024, ..Caps::baseline() };
        for first in [0, 1, 63, 64, 65, 1000] {
            let (window, rest) = cover(Arg(0), first, room(&caps), &caps);
            assert_eq!(window.offset % 256, 0);
            assert_eq!(window.offset / 4 + u64::from(rest), first);
            assert!(window.size.is_some_and(|s| s <= 1024), "{window:?}");
        }
    }
}
