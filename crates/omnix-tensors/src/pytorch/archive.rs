//! The directory of a zip archive as `torch.save` writes it: entries stored as they are, so that their bytes can be used in place.
//!
//! Layout (APPNOTE.TXT 6.3): entries, each behind a local header; the central directory, which names all of them; its end record, before
//! which larger archives have a second one with 64-bit numbers. Nothing here is as large as its numbers say until they were compared with
//! the file's length.

use std::collections::BTreeMap;
use std::ops::Range;

/// Why an archive is refused.
pub(super) type Flaw = String;

/// An entry: where its bytes lie, and how they are stored.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    pub(super) range: Range<usize>,
    /// 0 for bytes as they are.
    method: u16,
    encrypted: bool,
}

/// All entries by name.
#[derive(Debug)]
pub(super) struct Archive<'a> {
    bytes: &'a [u8],
    entries: BTreeMap<&'a [u8], Entry>,
}

const LOCAL: [u8; 4] = *b"PK\x03\x04";
const CENTRAL: [u8; 4] = *b"PK\x01\x02";
const END: [u8; 4] = *b"PK\x05\x06";
const END_64: [u8; 4] = *b"PK\x06\x06";
const LOCATOR_64: [u8; 4] = *b"PK\x06\x07";

impl<'a> Archive<'a> {
    /// Reads the directory.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, Flaw> {
        let (start, count) = directory(bytes)?;
        let mut entries = BTreeMap::new();
        let mut at = start;
        for _ in 0..count {
            let (name, entry, next) = central(bytes, at)?;
            if entries.insert(name, entry).is_some() {
                return Err(format!("its entry {} is there twice", name.escape_ascii()));
            }
            at = next;
        }
        Ok(Self { bytes, entries })
    }

    /// The whole file.
    pub(super) const fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// Whether there is such an entry.
    pub(super) fn has(&self, name: &str) -> bool {
        self.entries.contains_key(name.as_bytes())
    }

    /// Names of all entries, in order.
    pub(super) fn names(&self) -> impl Iterator<Item = &'a [u8]> {
        self.entries.keys().copied()
    }

    /// Where the bytes of an entry lie in the file.
    pub(super) fn range(&self, name: &str) -> Result<Range<usize>, Flaw> {
        let entry =
            self.entries.get(name.as_bytes()).ok_or_else(|| format!("it has no entry {name}: it is incomplete"))?;
        if entry.encrypted {
            return Err(format!("its entry {name} is encrypted"));
        }
        if entry.method != 0 {
            return Err(format!(
                "its entry {name} is compressed, which torch.save never does: pack it again without compression"
            ));
        }
        Ok(entry.range.clone())
    }

    /// The bytes of an entry.
    pub(super) fn get(&self, name: &str) -> Result<&'a [u8], Flaw> {
        Ok(&self.bytes[self.range(name)?])
    }
}

/// Where the central directory begins, and its number of entries.
fn directory(bytes: &[u8]) -> Result<(usize, u64), Flaw> {
    const RECORD: usize = 22;
    const COMMENT: usize = 0xffff;
    let cut = || "its directory is missing: it is cut short".to_owned();
    let last = bytes.len().checked_sub(RECORD).ok_or_else(cut)?;
    // A comment may follow the record.
    let end = (last.saturating_sub(COMMENT)..=last).rev().find(|&at| bytes[at..].starts_with(&END)).ok_or_else(cut)?;
    let (mut count, mut start) = (u64::from(u16_at(bytes, end + 10)?), u64::from(u32_at(bytes, end + 16)?));
    if let Some(locator) = end.checked_sub(20).filter(|&at| bytes[at..].starts_with(&LOCATOR_64)) {
        let record = place(bytes, u64_at(bytes, locator + 8)?)?;
        if !bytes[record..].starts_with(&END_64) {
            return Err("the second record of its directory is not where the first says".to_owned());
        }
        (count, start) = (u64_at(bytes, record + 32)?, u64_at(bytes, record + 48)?);
    }
    Ok((place(bytes, start)?, count))
}

/// An entry of the central directory: its name, what it is, and where the next one begins.
fn central(bytes: &[u8], at: usize) -> Result<(&[u8], Entry, usize), Flaw> {
    const FIXED: usize = 46;
    if !bytes.get(at..).is_some_and(|rest| rest.starts_with(&CENTRAL)) {
        return Err("its directory ends before all of its entries".to_owned());
    }
    let [name, extra, comment] = [28, 30, 32].map(|k| u16_at(bytes, at + k).map(usize::from));
    let (name, extra, comment) = (name?, extra?, comment?);
    let after_name = at + FIXED + name;
    let (name, extra_field) = (slice(bytes, at + FIXED, name)?, slice(bytes, after_name, extra)?);
    let [mut stored, mut length, mut local] = [0; 3];
    for (value, k) in [(&mut stored, 20), (&mut length, 24), (&mut local, 42)] {
        *value = u64::from(u32_at(bytes, at + k)?);
    }
    // 64-bit numbers stand in an extra field in this order, each only where its field of 32 bits is full.
    let mut wide = wide_numbers(extra_field).as_chunks::<8>().0.iter().map(|b| u64::from_le_bytes(*b));
    for value in [&mut length, &mut stored, &mut local] {
        if *value == u64::from(u32::MAX) {
            *value = wide.next().ok_or_else(|| format!("its entry {} has no length", name.escape_ascii()))?;
        }
    }
    let (flags, method) = (u16_at(bytes, at + 8)?, u16_at(bytes, at + 10)?);
    let outside = || format!("its entry {} lies outside of it: it is cut short", name.escape_ascii());
    let local = place(bytes, local).map_err(|_| outside())?;
    if !bytes[local..].starts_with(&LOCAL) {
        return Err(format!("its entry {} is not where the directory says", name.escape_ascii()));
    }
    let head = 30 + usize::from(u16_at(bytes, local + 26)?) + usize::from(u16_at(bytes, local + 28)?);
    let start = local + head;
    let length = usize::try_from(if method == 0 { length } else { stored }).map_err(|_| outside())?;
    let end = start.checked_add(length).filter(|&end| end <= bytes.len()).ok_or_else(outside)?;
    let entry = Entry { range: start..end, method, encrypted: flags & 1 != 0 };
    Ok((name, entry, after_name + extra + comment))
}

/// The contents of the extra field with 64-bit numbers.
fn wide_numbers(mut extra: &[u8]) -> &[u8] {
    while let Some((head, rest)) = extra.split_first_chunk::<4>() {
        let (id, length) =
            (u16::from_le_bytes([head[0], head[1]]), usize::from(u16::from_le_bytes([head[2], head[3]])));
        let Some((field, rest)) = rest.split_at_checked(length) else { break };
        if id == 1 {
            return field;
        }
        extra = rest;
    }
    &[]
}

/// A place inside of the file.
fn place(bytes: &[u8], at: u64) -> Result<usize, Flaw> {
    usize::try_from(at)
        .ok()
        .filter(|&at| at < bytes.len())
        .ok_or_else(|| "its directory points outside of it: it is cut short".to_owned())
}

fn slice(bytes: &[u8], at: usize, length: usize) -> Result<&[u8], Flaw> {
    bytes.get(at..).and_then(|rest| rest.get(..length)).ok_or_else(|| "its directory is cut short".to_owned())
}

fn number<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], Flaw> {
    slice(bytes, at, N).map(|b| *b.first_chunk().unwrap_or(&[0; N]))
}

fn u16_at(bytes: &[u8], at: usize) -> Result<u16, Flaw> {
    number(bytes, at).map(u16::from_le_bytes)
}

fn u32_at(bytes: &[u8], at: usize) -> Result<u32, Flaw> {
    number(bytes, at).map(u32::from_le_bytes)
}

fn u64_at(bytes: &[u8], at: usize) -> Result<u64, Flaw> {
    number(bytes, at).map(u64::from_le_bytes)
}
