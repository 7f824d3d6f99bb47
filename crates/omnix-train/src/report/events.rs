//! Event files of TensorBoard.
//!
//! A file is a list of records, little endian:
//!
//! ```text
//! u64 length of the data | u32 masked CRC of these 8 bytes | data | u32 masked CRC of the data
//! masked CRC = rotate_right(crc, 15) + 0xa282ead8,  crc = CRC-32C (Castagnoli, reflected 0x82f63b78)
//! ```
//!
//! The data is a protobuf message `Event`. Its fields that are used here (number, type):
//!
//! ```text
//! Event       1 wall_time double (seconds since 1970), 2 step int64, 3 file_version string, 5 summary Summary, 7 session_log SessionLog
//! Summary     1 value Value, repeated
//! Value       1 tag string, 2 simple_value float
//! SessionLog  1 status enum (START = 1)
//! ```
//!
//! The first record is the version `brain.Event:2`. A session that continues a run begins with a START at its first step: TensorBoard then
//! leaves out what a killed session wrote of later steps.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::Path;

/// A file of events, to which records are appended.
#[derive(Debug)]
pub(super) struct EventFile {
    file: File,
}

impl EventFile {
    /// Starts a file. `wall_time` is in seconds since 1970, `step` the first step that follows.
    ///
    /// # Errors
    /// As the system has them.
    pub(super) fn create(path: &Path, wall_time: f64, step: u64) -> io::Result<Self> {
        let mut events = Self { file: File::create(path)? };
        let mut version = event(wall_time, 0);
        bytes(&mut version, 3, b"brain.Event:2");
        let mut start = event(wall_time, step);
        bytes(&mut start, 7, &[key(1, 0), 1]);
        events.append(&version)?;
        events.append(&start)?;
        Ok(events)
    }

    /// Appends numbers of a step, by tag.
    ///
    /// # Errors
    /// As the system has them.
    pub(super) fn scalars(&mut self, wall_time: f64, step: u64, values: &[(String, f64)]) -> io::Result<()> {
        let mut summary = Vec::new();
        for (tag, number) in values {
            let mut value = Vec::new();
            bytes(&mut value, 1, tag.as_bytes());
            value.push(key(2, 5));
            value.extend((*number as f32).to_le_bytes());
            bytes(&mut summary, 1, &value);
        }
        let mut message = event(wall_time, step);
        bytes(&mut message, 5, &summary);
        self.append(&message)
    }

    /// Appends a record in one write, so that a program that is killed leaves at most one record cut short.
    fn append(&mut self, data: &[u8]) -> io::Result<()> {
        let length = (data.len() as u64).to_le_bytes();
        let mut record = Vec::with_capacity(data.len() + 16);
        record.extend(length);
        record.extend(masked_crc(&length).to_le_bytes());
        record.extend(data);
        record.extend(masked_crc(data).to_le_bytes());
        self.file.write_all(&record)
    }
}

/// The key of a field: 0 is a varint, 1 eight bytes, 2 a length and bytes, 5 four bytes.
const fn key(field: u8, kind: u8) -> u8 {
    field << 3 | kind
}

fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn bytes(out: &mut Vec<u8>, field: u8, data: &[u8]) {
    out.push(key(field, 2));
    varint(out, data.len() as u64);
    out.extend(data);
}

/// The beginning of an event.
fn event(wall_time: f64, step: u64) -> Vec<u8> {
    let mut out = vec![key(1, 1)];
    out.extend(wall_time.to_le_bytes());
    out.push(key(2, 0));
    varint(&mut out, step);
    out
}

fn masked_crc(data: &[u8]) -> u32 {
    let mut crc = !0u32;
    for byte in data {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = crc >> 1 ^ if crc & 1 == 1 { 0x82f6_3b78 } else { 0 };
        }
    }
    (!crc).rotate_right(15).wrapping_add(0xa282_ead8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_castagnoli_masked() {
        // The check value of CRC-32C: the digits 1 to 9.
        assert_eq!(masked_crc(b"123456789").wrapping_sub(0xa282_ead8).rotate_left(15), 0xe306_9283);
    }

    /// Bytes that TensorBoard's own writer leaves for the version at time 0, but for its order of fields.
    #[test]
    fn records_have_the_documented_bytes() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("events");
        let mut events = EventFile::create(&path, 0.0, 7).unwrap();
        events.scalars(1.5, 300, &[("loss".to_owned(), 0.25)]).unwrap();
        let all = std::fs::read(&path).unwrap();
        let mut records = Vec::new();
        let mut rest = all.as_slice();
        while let Some((head, tail)) = rest.split_first_chunk::<8>() {
            let length = u64::from_le_bytes(*head) as usize;
            assert_eq!(tail[..4], masked_crc(head).to_le_bytes());
            let data = &tail[4..4 + length];
            assert_eq!(tail[4 + length..8 + length], masked_crc(data).to_le_bytes());
            records.push(data.to_vec());
            rest = &tail[8 + length..];
        }
        assert!(rest.is_empty() && records.len() == 3);
        assert_eq!(records[0], [&[9, 0, 0, 0, 0, 0, 0, 0, 0, 16, 0, 26, 13][..], b"brain.Event:2"].concat());
        assert_eq!(records[1][9..], [16, 7, 58, 2, 8, 1]);
        let expected = [&[16, 0xac, 2, 42, 13, 10, 11, 10, 4][..], b"loss", &[21], &0.25f32.to_le_bytes()].concat();
        assert_eq!(records[2][9..], expected);
    }
}
