//! Numbers and names in the form in which the page holds them: base64, 16-bit codes, escaped text.

use super::super::{atomic::AtomicFile, motion::MovingPoints};
use crate::IoError;

/// Codes of 16 bits run from 0 to this.
const TOP: f64 = 65535.0;

/// Base64 (RFC 4648, with padding) onto a file as the bytes come.
pub(super) struct Base64<'a> {
    file: &'a mut AtomicFile,
    /// Bytes that do not fill a group of three yet.
    waiting: [u8; 3],
    filled: usize,
    /// Characters on their way to the file.
    out: Vec<u8>,
}

const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

impl<'a> Base64<'a> {
    const CHUNK: usize = 1 << 14;

    pub(super) fn new(file: &'a mut AtomicFile) -> Self {
        Self { file, waiting: [0; 3], filled: 0, out: Vec::with_capacity(Self::CHUNK + 4) }
    }

    pub(super) fn put(&mut self, bytes: &[u8]) -> Result<(), IoError> {
        for &byte in bytes {
            self.waiting[self.filled] = byte;
            self.filled += 1;
            if self.filled == 3 {
                self.out.extend(quad(self.waiting));
                self.filled = 0;
                if self.out.len() >= Self::CHUNK {
                    self.file.put(&self.out)?;
                    self.out.clear();
                }
            }
        }
        Ok(())
    }

    /// Writes the last, padded group.
    pub(super) fn finish(mut self) -> Result<(), IoError> {
        if self.filled > 0 {
            self.waiting[self.filled..].fill(0);
            let mut last = quad(self.waiting);
            last[self.filled + 1..].fill(b'=');
            self.out.extend(last);
        }
        self.file.put(&self.out)
    }
}

fn quad([a, b, c]: [u8; 3]) -> [u8; 4] {
    let bits = u32::from_be_bytes([0, a, b, c]);
    [18, 12, 6, 0].map(|shift| ALPHABET[(bits >> shift & 63) as usize])
}

/// The box that holds every position, the unit of position codes: `low + code / 65535 * (high - low)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PositionBox {
    pub(super) low: [f32; 3],
    pub(super) high: [f32; 3],
}

impl PositionBox {
    /// Around all positions of these points, which are finite. Without points it is the origin.
    pub(super) fn of(points: &MovingPoints, which: impl Iterator<Item = usize> + Clone) -> Self {
        let mut found = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };
        for time in 0..points.views.len() {
            for point in which.clone() {
                for (axis, value) in points.position(time, point).into_iter().enumerate() {
                    found.low[axis] = found.low[axis].min(value);
                    found.high[axis] = found.high[axis].max(value);
                }
            }
        }
        if found.low[0] > found.high[0] { Self { low: [0.0; 3], high: [0.0; 3] } } else { found }
    }

    /// The nearest codes. An axis without extent has code 0.
    pub(super) fn codes(&self, position: [f32; 3]) -> [u16; 3] {
        std::array::from_fn(|axis| {
            let (low, high) = (f64::from(self.low[axis]), f64::from(self.high[axis]));
            // `as` saturates, and sends the NaN of 0 / 0 to 0.
            ((f64::from(position[axis]) - low) / (high - low) * TOP).round() as u16
        })
    }
}

/// 0..1 as a code; values outside are clamped, NaN is 0.
pub(super) fn unit_code(value: f32) -> u16 {
    (f64::from(value) * TOP).round() as u16
}

/// Least and greatest positive finite confidence; both 1 where there is none.
pub(super) fn confidence_range(points: &MovingPoints, which: impl Iterator<Item = usize>) -> [f32; 2] {
    let usable = which.map(|point| points.confidence[point]).filter(|c| c.is_finite() && *c > 0.0);
    let [low, high] = usable.fold([f32::INFINITY, 0.0], |[low, high], c| [c.min(low), c.max(high)]);
    if low > high { [1.0; 2] } else { [low, high] }
}

/// A confidence as a code: `low * (high / low)^(code / 65535)`. What is not a positive finite number is 0.
pub(super) fn confidence_code(value: f32, [low, high]: [f32; 2]) -> u16 {
    let [value, low, high] = [value, low, high].map(f64::from);
    if !(value.is_finite() && value > 0.0 && high > low) {
        return 0;
    }
    ((value / low).ln() / (high / low).ln() * TOP).round() as u16
}

/// Text for an HTML element or attribute.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// JSON for a script element: nothing in it can end the element. In JSON `<` stands only inside strings.
pub(super) fn script_json(value: &serde_json::Value) -> String {
    value.to_string().replace('<', "\\u003c")
}
