//! Whether the data of a JPEG is all there.
//!
//! Decoders fill what is missing with grey and say nothing, and an end marker proves nothing: a file that was cut off and closed by
//! a program has one, while some phones and drones leave it out of whole pictures. So the entropy-coded data is walked here,
//! Huffman code by Huffman code (ITU-T T.81, sections F.2.2 and G.2), and blocks are counted; no coefficient is computed.
//! Arithmetic coding and lossless frames are not walked: for them the end marker has to do.

use super::jpeg_bits::{Bits, Table};

/// What is wrong with the data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Fault {
    /// It ends before its last block.
    Missing(String),
    /// It holds what no encoder writes.
    Damaged(String),
}

/// Walks the first picture of a file; none if its data is whole.
pub(super) fn fault(bytes: &[u8]) -> Option<Fault> {
    let mut walk = Walk { bytes, at: 2, frame: None, tables: Default::default(), restart: 0 };
    match walk.run() {
        Ok(true) => None,
        Ok(false) if bytes.windows(2).rev().any(|w| w == [0xff, EOI]) => None,
        Ok(false) => Some(Fault::Missing("it has no end-of-image marker".into())),
        Err(fault) => Some(fault),
    }
}

const EOI: u8 = 0xd9;

struct Walk<'a> {
    bytes: &'a [u8],
    at: usize,
    frame: Option<Frame>,
    /// Of DC and of AC coefficients.
    tables: [[Option<Table>; 4]; 2],
    /// Units between two restart markers; 0 for none.
    restart: usize,
}

struct Frame {
    progressive: bool,
    width: usize,
    height: usize,
    /// Largest sampling factors.
    most: (usize, usize),
    components: Vec<Component>,
}

struct Component {
    id: u8,
    /// Sampling factors.
    across: usize,
    down: usize,
    /// Blocks in a row of whole units.
    stride: usize,
    /// Of progressive frames: which coefficients of each block are not zero, a bit each.
    known: Vec<u64>,
    /// How many low bits of each coefficient are still to come; `NEVER` before its first scan.
    to_come: [u8; 64],
}

const NEVER: u8 = 255;

/// One component's share of a scan: its place in the frame and its tables.
struct Part {
    component: usize,
    dc: usize,
    ac: usize,
}

/// What a scan codes: coefficients from `first` to `last`, their bits from `low` on; a refinement adds one bit.
#[derive(Clone, Copy)]
struct Band {
    first: usize,
    last: usize,
    refine: bool,
    low: u8,
}

fn damaged(what: &str) -> Fault {
    Fault::Damaged(what.to_owned())
}

fn missing(what: &str) -> Fault {
    Fault::Missing(what.to_owned())
}

impl<'a> Walk<'a> {
    /// Whether the data could be walked to its end.
    fn run(&mut self) -> Result<bool, Fault> {
        loop {
            let Some((marker, segment)) = self.segment() else {
                return self.seen(true).map(|()| true);
            };
            match marker {
                0xc0..=0xc2 if self.frame.is_none() => {
                    self.frame = Some(Frame::new(marker, segment).ok_or_else(|| damaged("in its frame header"))?);
                }
                0xc0..=0xc2 => return Err(damaged("a second frame header")),
                0xc4 => self.read_tables(segment).ok_or_else(|| damaged("in its Huffman tables"))?,
                // Arithmetic coding, lossless and hierarchical frames.
                0xc3 | 0xc5..=0xc7 | 0xc9..=0xcf => return Ok(false),
                0xdd => self.restart = segment.get(..2).map_or(0, |b| usize::from(u16::from_be_bytes([b[0], b[1]]))),
                0xda if !self.scan(segment)? => return Ok(false),
                // A sequential picture is whole when every component has been seen; what follows may be anything.
                0xda if self.frame.as_ref().is_some_and(|f| !f.progressive) && self.seen(false).is_ok() => {
                    return Ok(true);
                }
                EOI => return self.seen(false).map(|()| true),
                _ => {}
            }
        }
    }

    /// The next marker and its segment, past bytes that are neither; none at the end of the file.
    fn segment(&mut self) -> Option<(u8, &'a [u8])> {
        loop {
            let rest = self.bytes.get(self.at..)?;
            let start = rest.windows(2).position(|w| w[0] == 0xff && !matches!(w[1], 0x00 | 0xff))?;
            let marker = rest[start + 1];
            self.at += start + 2;
            match marker {
                0x01 | 0xd0..=0xd8 => {}
                EOI => return Some((marker, &[])),
                _ => {
                    let length = self.bytes.get(self.at..self.at + 2)?;
                    let length = usize::from(u16::from_be_bytes([length[0], length[1]])).max(2);
                    let segment = self.bytes.get(self.at + 2..self.at + length)?;
                    self.at += length;
                    return Some((marker, segment));
                }
            }
        }
    }

    /// Whether every component has come; with `all` whether every bit of every coefficient has, which an end marker makes
    /// superfluous: encoders may leave fine scans out.
    fn seen(&self, all: bool) -> Result<(), Fault> {
        let Some(frame) = &self.frame else { return Err(missing("it has no picture")) };
        for component in &frame.components {
            let to_come = component.to_come;
            if to_come[0] == NEVER || (all && to_come.iter().any(|bits| *bits != 0)) {
                return Err(missing("its last scans are not there"));
            }
        }
        Ok(())
    }

    fn read_tables(&mut self, mut segment: &[u8]) -> Option<()> {
        while let Some((&class, rest)) = segment.split_first() {
            let counts: &[u8; 16] = rest.first_chunk()?;
            let number: usize = counts.iter().map(|n| usize::from(*n)).sum();
            let values = rest.get(16..16 + number)?;
            *self.tables.get_mut(usize::from(class >> 4))?.get_mut(usize::from(class & 15))? =
                Some(Table::new(counts, values)?);
            segment = &rest[16 + number..];
        }
        Some(())
    }

    /// Walks one scan; false where its kind is not known here.
    fn scan(&mut self, segment: &[u8]) -> Result<bool, Fault> {
        let Some(frame) = &mut self.frame else { return Err(damaged("a scan before its frame header")) };
        let (parts, band) = scan_header(frame, segment).ok_or_else(|| damaged("in a scan header"))?;
        let needs = |class: usize, index: usize| self.tables[class][index].is_none();
        let unknown = |part: &Part| {
            (band.first == 0 && !band.refine && needs(0, part.dc)) || (band.last > 0 && needs(1, part.ac))
        };
        // Without tables a decoder may know those of its own.
        if parts.iter().any(unknown) {
            return Ok(false);
        }
        let grid = frame.grid(&parts);
        let units = grid.0 * grid.1;
        let mut bits = Bits::new(self.bytes, self.at);
        let mut run = 0u32;
        for unit in 0..units {
            if self.restart > 0 && unit > 0 && unit % self.restart == 0 {
                run = 0;
                if !bits.restart() {
                    return Err(Fault::Missing(format!("{unit} of {units} blocks of a scan are there")));
                }
            }
            let walked = frame.unit(&parts, band, &self.tables, (unit % grid.0, unit / grid.0), &mut bits, &mut run);
            // The last code may lack the bits that fill its byte.
            let spare = if unit + 1 == units { 7 } else { 0 };
            if bits.missing() > spare || (walked.is_none() && bits.at_end()) {
                return Err(Fault::Missing(format!("{unit} of {units} blocks of a scan are there")));
            }
            walked.ok_or_else(|| Fault::Damaged(format!("an impossible code in block {unit} of {units} of a scan")))?;
        }
        for part in &parts {
            frame.components[part.component].to_come[band.first..=band.last].fill(band.low);
        }
        self.at = bits.position();
        Ok(true)
    }
}

/// The components and the band of a scan.
fn scan_header(frame: &Frame, segment: &[u8]) -> Option<(Vec<Part>, Band)> {
    let number = usize::from(*segment.first()?);
    let tail = segment.get(1 + 2 * number..4 + 2 * number)?;
    let part = |c: &[u8]| {
        let component = frame.components.iter().position(|known| known.id == c[0])?;
        let (dc, ac) = (usize::from(c[1] >> 4), usize::from(c[1] & 15));
        (dc < 4 && ac < 4).then_some(Part { component, dc, ac })
    };
    let parts: Option<Vec<Part>> = segment[1..1 + 2 * number].chunks_exact(2).map(part).collect();
    let parts = parts.filter(|p| (1..=4).contains(&p.len()))?;
    if !frame.progressive {
        return Some((parts, Band { first: 0, last: 63, refine: false, low: 0 }));
    }
    let band =
        Band { first: usize::from(tail[0]), last: usize::from(tail[1]), refine: tail[2] >> 4 != 0, low: tail[2] & 15 };
    let fits = band.first <= band.last && band.last <= 63 && (band.last == 0 || (band.first > 0 && parts.len() == 1));
    fits.then_some((parts, band))
}

impl Frame {
    fn new(marker: u8, segment: &[u8]) -> Option<Self> {
        let side = |at: usize| Some(usize::from(u16::from_be_bytes([*segment.get(at)?, *segment.get(at + 1)?])));
        let (height, width) = (side(1)?, side(3)?);
        let listed = segment.get(6..6 + 3 * usize::from(*segment.get(5)?))?;
        let factors = || listed.chunks_exact(3).map(|c| (usize::from(c[1] >> 4), usize::from(c[1] & 15)));
        let most = factors().fold((0, 0), |(a, b), (across, down)| (a.max(across), b.max(down)));
        let allowed = factors().all(|(across, down)| (1..=4).contains(&across) && (1..=4).contains(&down));
        if !allowed || width == 0 || height == 0 || listed.is_empty() {
            return None;
        }
        let progressive = marker == 0xc2;
        let columns = width.div_ceil(8 * most.0);
        let rows = height.div_ceil(8 * most.1);
        let components = listed.chunks_exact(3).zip(factors()).map(|(c, (across, down))| {
            let stride = columns * across;
            let known = if progressive { vec![0; stride * rows * down] } else { Vec::new() };
            Component { id: c[0], across, down, stride, known, to_come: [NEVER; 64] }
        });
        Some(Self { progressive, width, height, most, components: components.collect() })
    }

    /// Units of a scan across and down. A component that comes alone has no blocks beyond its edge.
    fn grid(&self, parts: &[Part]) -> (usize, usize) {
        match parts {
            [part] => {
                let c = &self.components[part.component];
                let blocks = |side: usize, factor: usize, most: usize| (side * factor).div_ceil(most).div_ceil(8);
                (blocks(self.width, c.across, self.most.0), blocks(self.height, c.down, self.most.1))
            }
            _ => (self.width.div_ceil(8 * self.most.0), self.height.div_ceil(8 * self.most.1)),
        }
    }

    /// Walks one unit: a block of a component that comes alone, else a rectangle of blocks of each.
    fn unit(
        &mut self,
        parts: &[Part],
        band: Band,
        tables: &[[Option<Table>; 4]; 2],
        (column, row): (usize, usize),
        bits: &mut Bits<'_>,
        run: &mut u32,
    ) -> Option<()> {
        let alone = parts.len() == 1;
        for part in parts {
            let component = &mut self.components[part.component];
            let (across, down) = if alone { (1, 1) } else { (component.across, component.down) };
            let (dc, ac) = (tables[0][part.dc].as_ref(), tables[1][part.ac].as_ref());
            for y in 0..down {
                for x in 0..across {
                    if !self.progressive {
                        sequential(dc?, ac?, bits)?;
                    } else if band.first == 0 {
                        if band.refine {
                            bits.skip(1);
                        } else {
                            let size = bits.code(dc?)?;
                            bits.skip(u32::from(size & 15));
                        }
                    } else {
                        let block = (row * down + y) * component.stride + column * across + x;
                        let known = component.known.get_mut(block)?;
                        if band.refine {
                            refine(ac?, band, known, bits, run)?;
                        } else {
                            first_bits(ac?, band, known, bits, run)?;
                        }
                    }
                }
            }
        }
        Some(())
    }
}

/// All coefficients of a block.
fn sequential(dc: &Table, ac: &Table, bits: &mut Bits<'_>) -> Option<()> {
    let size = bits.code(dc)?;
    bits.skip(u32::from(size & 15));
    let mut k = 1;
    while k < 64 {
        let code = bits.code(ac)?;
        let (zeros, size) = (usize::from(code >> 4), u32::from(code & 15));
        if size == 0 && zeros < 15 {
            break;
        }
        k += zeros + 1;
        if size > 0 && k > 64 {
            return None;
        }
        bits.skip(size);
    }
    Some(())
}

/// The first bits of a band of AC coefficients; `run` blocks in a row have no more of them.
fn first_bits(ac: &Table, band: Band, known: &mut u64, bits: &mut Bits<'_>, run: &mut u32) -> Option<()> {
    if *run > 0 {
        *run -= 1;
        return Some(());
    }
    let mut k = band.first;
    while k <= band.last {
        let code = bits.code(ac)?;
        let (zeros, size) = (usize::from(code >> 4), u32::from(code & 15));
        if size == 0 && zeros < 15 {
            *run = (1 << zeros) - 1 + bits.take(zeros as u32);
            break;
        }
        k += zeros;
        if size > 0 {
            if k > 63 {
                return None;
            }
            *known |= 1 << k;
            bits.skip(size);
        }
        k += 1;
    }
    Some(())
}

/// One more bit of a band: of every coefficient that is known, and the first of some that were zero.
fn refine(ac: &Table, band: Band, known: &mut u64, bits: &mut Bits<'_>, run: &mut u32) -> Option<()> {
    let mut k = band.first;
    while *run == 0 && k <= band.last {
        let code = bits.code(ac)?;
        let (mut zeros, size) = (u32::from(code >> 4), code & 15);
        if size == 0 && zeros < 15 {
            *run = (1 << zeros) + bits.take(zeros);
            break;
        }
        if size > 0 {
            bits.skip(1);
        }
        while k <= band.last {
            if *known >> k & 1 == 1 {
                bits.skip(1);
            } else if zeros == 0 {
                break;
            } else {
                zeros -= 1;
            }
            k += 1;
        }
        if size > 0 && k <= band.last {
            *known |= 1 << k;
        }
        k += 1;
    }
    if *run > 0 {
        for k in k..=band.last {
            bits.skip((*known >> k & 1) as u32);
        }
        *run -= 1;
    }
    Some(())
}
