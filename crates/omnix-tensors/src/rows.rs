//! Scattered rows of a table in a file, read in few pieces.

use std::ops::Range;

/// Bytes between two rows that are read with them, since that costs less than to begin another read.
const GAP: usize = 4096;
/// Bytes of rows that are read together.
const SPAN: usize = 1 << 20;

/// The rows of `row` bytes each, in the order of `rows`, in which the same may occur again. `read` gives bytes of the table, counted
/// from the start of its row 0; rows that lie close together are read together, and each byte at most once.
///
/// # Errors
/// Those of `read`.
pub fn scattered<E>(
    rows: &[u32],
    row: usize,
    read: &mut dyn FnMut(Range<usize>) -> Result<Vec<u8>, E>,
) -> Result<Vec<u8>, E> {
    let mut sorted: Vec<(usize, usize)> = rows.iter().map(|r| *r as usize).zip(0..).collect();
    sorted.sort_unstable();
    let mut out = vec![0; rows.len() * row];
    let most = (SPAN / row.max(1)).max(1);
    let mut rest = sorted.as_slice();
    while let Some(&(first, _)) = rest.first() {
        let near = |pair: &[(usize, usize)]| (pair[1].0 - pair[0].0).saturating_sub(1).saturating_mul(row) <= GAP;
        let count = 1 + rest.windows(2).take_while(|pair| near(pair) && pair[1].0 - first < most).count();
        let (span, later) = rest.split_at(count);
        let bytes = read(first * row..(span[count - 1].0 + 1) * row)?;
        for (r, to) in span {
            out[to * row..(to + 1) * row].copy_from_slice(&bytes[(r - first) * row..][..row]);
        }
        rest = later;
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_in_the_order_asked_and_little_else_is_read() {
        for row in [1, 12, 128, 5000, SPAN + 1] {
            let count = if row > 1000 { 40u32 } else { 100_000 };
            let byte = |at: usize| (at * 7 % 251) as u8;
            let last = count - 1;
            let rows = [last, 0, 3, 3, 17, last / 2, 2, last];
            let (mut reads, mut total) = (0, 0);
            let found = scattered(&rows, row, &mut |range| -> Result<Vec<u8>, ()> {
                reads += 1;
                total += range.len();
                assert!(range.end <= count as usize * row, "beyond the table");
                Ok(range.map(byte).collect())
            });
            let expected: Vec<u8> =
                rows.iter().flat_map(|r| (*r as usize * row..(*r as usize + 1) * row).map(byte)).collect();
            assert!(found.unwrap() == expected, "{row}");
            assert!(reads <= 6 && total <= 6 * row + 2 * GAP, "{row}: {reads} reads of {total} bytes");
        }
        // All rows: in pieces of a bounded size.
        let all: Vec<u32> = (0..3 << 20).collect();
        let mut longest = 0;
        let read = scattered(&all, 1, &mut |range| {
            longest = longest.max(range.len());
            Ok::<_, ()>(vec![1; range.len()])
        });
        assert!(read.unwrap().len() == 3 << 20 && longest == SPAN);
        assert_eq!(scattered(&[], 4, &mut |_| Err("a read for nothing")), Ok(Vec::new()));
        assert_eq!(scattered(&[1], 4, &mut |_| Err("failed")), Err("failed"));
    }
}
