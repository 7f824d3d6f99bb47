//! Zeroed, page-aligned memory of the program, in huge pages where the system has them.

use std::io;
use std::num::NonZero;
use std::ops::{Deref, DerefMut};
use std::thread::{Builder, available_parallelism};

use memmap2::{MmapMut, MmapOptions};

use crate::dispatch::round_up;

/// Where buffers start: at a huge page.
const HUGE_PAGE: u64 = 2 << 20;
/// What a driver may take of it is a multiple of this.
pub(super) const PAGE: u64 = 4 << 10;

/// Zeroed memory for one buffer, which [`crate::Gpu::import`] gives to a device.
#[derive(Debug)]
pub struct HostMemory {
    map: MmapMut,
    start: usize,
    bytes: usize,
}

impl HostMemory {
    /// `bytes` zeros. Pages are made when they are touched.
    pub(crate) fn zeroed(bytes: u64) -> io::Result<Self> {
        let too_much = |_| io::Error::from(io::ErrorKind::OutOfMemory);
        let length = usize::try_from(round_up(bytes, PAGE) + HUGE_PAGE).map_err(too_much)?;
        let map = MmapOptions::new().len(length).map_anon()?;
        let at = map.as_ptr().addr();
        let start = at.next_multiple_of(HUGE_PAGE as usize) - at;
        let bytes = bytes as usize;
        // Only whole huge pages: rounding the tail up would use memory the plan did not count. Where the system refuses,
        // everything works and takes longer.
        #[cfg(target_os = "linux")]
        {
            let whole = bytes - bytes % HUGE_PAGE as usize;
            let rest = start + whole;
            let _ = map.advise_range(memmap2::Advice::HugePage, start, whole);
            let _ = map.advise_range(memmap2::Advice::NoHugePage, rest, length - rest);
        }
        Ok(Self { map, start, bytes })
    }

    /// Makes all pages now, on all processors: at first use in a shader one processor clears a page that the others wait for.
    ///
    /// # Errors
    /// When memory runs out.
    pub(crate) fn populate(&self) -> io::Result<()> {
        let share = self.bytes.div_ceil(available_parallelism().map_or(1, NonZero::get));
        let share = share.next_multiple_of(HUGE_PAGE as usize);
        // Threads of its own: rayon's might run other work meanwhile, of a caller that holds a lock.
        std::thread::scope(|scope| {
            // Where no thread is to be had, first use makes the pages.
            let touch = |at| Builder::new().spawn_scoped(scope, move || self.touch(at, share)).ok();
            let others: Vec<_> = (share..self.bytes).step_by(share).filter_map(touch).collect();
            let first = self.touch(0, share);
            others.into_iter().map(|thread| thread.join().unwrap_or(Ok(()))).fold(first, Result::and)
        })
    }

    /// Makes the pages of up to `length` bytes from `at` on.
    #[cfg(target_os = "linux")]
    fn touch(&self, at: usize, length: usize) -> io::Result<()> {
        let length = length.min(self.bytes - at);
        match self.map.advise_range(memmap2::Advice::PopulateWrite, self.start + at, length) {
            Err(error) if error.kind() == io::ErrorKind::OutOfMemory => Err(error),
            // Not known before Linux 5.14, where first use makes them.
            _ => Ok(()),
        }
    }

    #[cfg(not(target_os = "linux"))]
    fn touch(&self, _: usize, _: usize) -> io::Result<()> {
        Ok(())
    }
}

impl Deref for HostMemory {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.map[self.start..self.start + self.bytes]
    }
}

impl DerefMut for HostMemory {
    fn deref_mut(&mut self) -> &mut [u8] {
        &mut self.map[self.start..self.start + self.bytes]
    }
}

#[cfg(test)]
mod tests {
    use super::{HUGE_PAGE, HostMemory};

    #[test]
    fn memory_is_zeros_at_a_huge_page_of_any_size() {
        for bytes in [1, 4096, 4097, HUGE_PAGE - 1, HUGE_PAGE + 1, 3 * HUGE_PAGE] {
            let mut memory = HostMemory::zeroed(bytes).expect("little memory");
            memory.populate().expect("little memory");
            assert_eq!((memory.len() as u64, memory.as_ptr() as u64 % HUGE_PAGE), (bytes, 0));
            assert!(memory.iter().all(|byte| *byte == 0));
            memory.fill(1);
        }
        assert!(HostMemory::zeroed(u64::MAX / 2).is_err());
    }
}
