//! Bits and Huffman codes of a JPEG's entropy-coded data (ITU-T T.81, section F.2.2.3 to F.2.2.5, annex C).

/// A Huffman table: for every 16 bits the length of the code they begin with, and its value.
pub(super) struct Table(Vec<(u8, u8)>);

impl Table {
    /// From the number of codes of each length and their values; none if there are more codes than lengths allow.
    pub(super) fn new(counts: &[u8; 16], values: &[u8]) -> Option<Self> {
        let mut entries = vec![(0, 0); 1 << 16];
        let mut values = values.iter();
        let mut at = 0;
        for (length, count) in (1u8..).zip(counts) {
            for _ in 0..*count {
                let span = 1 << (16 - length);
                entries.get_mut(at..at + span)?.fill((length, *values.next()?));
                at += span;
            }
        }
        Some(Self(entries))
    }
}

/// Reads bits up to the next marker; beyond it come zeros, which are counted.
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    /// The next byte.
    at: usize,
    buffer: u64,
    /// Bits in the buffer.
    held: u32,
    /// How many of them, the last ones, are not in the file.
    padding: u32,
    /// Bits that were used and are not in the file.
    missing: u64,
}

impl<'a> Bits<'a> {
    pub(super) fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at, buffer: 0, held: 0, padding: 0, missing: 0 }
    }

    /// Makes at least 32 bits ready.
    fn fill(&mut self) {
        while self.held <= 56 {
            let byte = self.bytes.get(self.at).copied();
            let next = self.bytes.get(self.at + 1).copied();
            let byte = match (byte, next) {
                // A stuffed zero is no data.
                (Some(0xff), Some(0)) => {
                    self.at += 2;
                    0xff
                }
                // Fill bytes may come before a marker.
                (Some(0xff), Some(0xff)) => {
                    self.at += 1;
                    continue;
                }
                (Some(0xff), _) | (None, _) => {
                    self.padding += 8;
                    0
                }
                (Some(byte), _) => {
                    self.at += 1;
                    byte
                }
            };
            self.buffer = self.buffer << 8 | u64::from(byte);
            self.held += 8;
        }
    }

    /// Drops `count` bits, 32 at most.
    pub(super) fn skip(&mut self, count: u32) {
        if self.held < count {
            self.fill();
        }
        self.held -= count;
        if self.padding > self.held {
            self.missing += u64::from(self.padding - self.held);
            self.padding = self.held;
        }
    }

    /// The next `count` bits, 16 at most, as a number.
    pub(super) fn take(&mut self, count: u32) -> u32 {
        if count == 0 {
            return 0;
        }
        if self.held < count {
            self.fill();
        }
        let value = (self.buffer >> (self.held - count)) as u32 & ((1 << count) - 1);
        self.skip(count);
        value
    }

    /// The value of the next code; none if there is no such code.
    pub(super) fn code(&mut self, table: &Table) -> Option<u8> {
        if self.held < 16 {
            self.fill();
        }
        let (length, value) = table.0[(self.buffer >> (self.held - 16)) as usize & 0xffff];
        self.skip(u32::from(length));
        (length > 0).then_some(value)
    }

    /// Bits used beyond the data.
    pub(super) fn missing(&self) -> u64 {
        self.missing
    }

    /// Whether less than a byte of the data is left, which may be filling.
    pub(super) fn at_end(&self) -> bool {
        self.padding > 0 && self.held - self.padding < 8
    }

    /// Goes on after the next restart marker; false where another marker or the end comes first.
    pub(super) fn restart(&mut self) -> bool {
        (self.held, self.padding) = (0, 0);
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        match rest.windows(2).position(|w| w[0] == 0xff && !matches!(w[1], 0x00 | 0xff)) {
            Some(start) if matches!(rest[start + 1], 0xd0..=0xd7) => {
                self.at += start + 2;
                true
            }
            _ => false,
        }
    }

    /// Where the next marker is looked for.
    pub(super) fn position(&self) -> usize {
        self.at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_bits() {
        // 0: 5, 10: 6, 11 is not given.
        let mut counts = [0; 16];
        (counts[0], counts[1]) = (1, 1);
        let table = Table::new(&counts, &[5, 6]).unwrap();
        let mut bits = Bits::new(&[0b0101_0110, 0xff, 0x00, 0xff, 0xd9], 0);
        assert_eq!([bits.code(&table), bits.code(&table), bits.code(&table)], [Some(5), Some(6), Some(6)]);
        assert_eq!((bits.take(3), bits.take(8)), (0b110, 0xff), "a stuffed zero is left out");
        assert_eq!(bits.missing(), 0);
        assert_eq!((bits.take(4), bits.missing()), (0, 4), "nothing is read beyond a marker");
        assert_eq!(Bits::new(&[0xff, 0xfe], 0).code(&table), Some(5));
        assert_eq!(Bits::new(&[0b1100_0000], 0).code(&table), None);
    }

    #[test]
    fn more_codes_than_fit_are_no_table() {
        let mut counts = [0; 16];
        counts[0] = 3;
        assert!(Table::new(&counts, &[1, 2, 3]).is_none());
        assert!(Table::new(&[1; 16], &[0; 3]).is_none(), "fewer values than codes");
    }

    #[test]
    fn restarts() {
        let mut bits = Bits::new(&[0x12, 0xff, 0xd0, 0x34, 0xff, 0xd9], 0);
        assert_eq!(bits.take(4), 1);
        assert!(bits.restart());
        assert_eq!(bits.take(8), 0x34);
        assert!(!bits.restart(), "the end comes first");
    }
}
