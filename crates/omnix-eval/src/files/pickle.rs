//! Byte strings out of a pickled numpy array of objects, which is how some TAPVid-3D files hold their pictures.
//!
//! A pickle is a program for Python. Nothing of it is executed here: its instructions are walked over, and the byte strings of the list of
//! elements are taken. An instruction that such arrays do not have is an error.

/// The byte strings of the array, in order; one that occurs twice as the same object is there once.
///
/// # Errors
/// In words: what the bytes are not.
pub fn byte_strings(bytes: &[u8]) -> Result<Vec<Vec<u8>>, String> {
    let mut at = Walk { rest: bytes };
    let (mut found, mut in_list) = (Vec::new(), false);
    loop {
        match at.take(1)?[0] {
            // Protocol; integers and memo of one byte.
            0x80 | b'K' | b'h' | b'q' => _ = at.take(1)?,
            b'M' => _ = at.take(2)?,
            // Integers and memo of four bytes, a frame's length of eight.
            b'J' | b'j' | b'r' => _ = at.take(4)?,
            0x95 => _ = at.take(8)?,
            // Two lines: the name of a function.
            b'c' => {
                at.line()?;
                at.line()?;
            }
            // Text.
            0x8c => _ = at.counted(1)?,
            b'X' => _ = at.counted(4)?,
            // Byte strings.
            code @ (b'C' | b'U' | b'B' | b'T' | 0x8e) => {
                let size = match code {
                    b'C' | b'U' => 1,
                    b'B' | b'T' => 4,
                    _ => 8,
                };
                let string = at.counted(size)?;
                if in_list {
                    found.push(string.to_vec());
                }
            }
            // The list of elements begins.
            b']' => in_list = true,
            // Tuples, marks, None, true, false, calls, states, appending, memoising.
            b'(' | b')' | b't' | 0x85..=0x87 | b'N' | 0x88 | 0x89 | b'R' | b'b' | b'a' | b'e' | 0x93 | 0x94 => {}
            b'.' => break,
            code => {
                return Err(format!(
                    "a pickle with the instruction {code:#04x}, which arrays of byte strings do not have"
                ));
            }
        }
    }
    if found.is_empty() {
        return Err("a pickle without byte strings".to_owned());
    }
    Ok(found)
}

struct Walk<'a> {
    rest: &'a [u8],
}

impl<'a> Walk<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or("a pickle that is cut short")?;
        self.rest = rest;
        Ok(taken)
    }

    /// Bytes after their number, which takes `size` bytes.
    fn counted(&mut self, size: usize) -> Result<&'a [u8], String> {
        let mut number = [0; 8];
        number[..size].copy_from_slice(self.take(size)?);
        let count = usize::try_from(u64::from_le_bytes(number)).map_err(|_| "a pickle that is cut short")?;
        self.take(count)
    }

    fn line(&mut self) -> Result<(), String> {
        let end = self.rest.iter().position(|&b| b == b'\n').ok_or("a pickle that is cut short")?;
        self.take(end + 1).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_of_the_list_are_found_and_others_are_not() {
        let pickle = b"\x80\x04\x8c\x03abcC\x01b](B\x02\x00\x00\x00xyC\x01ze.";
        assert_eq!(byte_strings(pickle).unwrap(), [b"xy".to_vec(), b"z".to_vec()]);
    }

    #[test]
    fn cut_and_foreign_pickles_are_errors() {
        let pickle = b"\x80\x04](B\x02\x00\x00\x00xye.";
        for end in 0..pickle.len() {
            assert!(byte_strings(&pickle[..end]).is_err(), "{end}");
        }
        assert!(byte_strings(b"\x80\x04i.").is_err());
        assert!(byte_strings(b"\x80\x04].").is_err());
        assert!(byte_strings(b"](\x8e\xff\xff\xff\xff\xff\xff\xff\xff").is_err());
    }
}
