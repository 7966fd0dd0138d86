//! How the allocator of the program treats large blocks: what is freed goes back to the system at once.
//!
//! A tile is a few dozen columns of megabytes that live for a second. glibc gives a block of at least 128 KiB a mapping of its
//! own at first, but raises that limit to the size of each such block that is freed, up to 32 MiB (mallopt(3),
//! `M_MMAP_THRESHOLD`): after the first tiles the columns come out of the heaps of the workers, where what is freed stays for as
//! long as anything above it lives. What one worker held so grew from tile to tile: over a drive of 4 km, whose tiles need 30 to
//! 70 MiB, from 50 to 105 MiB. A limit that is set is not raised.

/// Blocks of this many bytes and more get a mapping of their own. Chosen: of a tile, only columns of cells are smaller; and the
/// buffers that come and go with every block of records, which are about a megabyte and more, are few.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const MAPPED_BYTES: libc::c_int = 1 << 20;

/// Has memory of large blocks go back to the system when they are freed. To be called before there is a second thread.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(unsafe_code, reason = "a setting of the C library can only be made by an unsafe call")]
pub(crate) fn return_large_blocks() {
    // SAFETY: mallopt takes two numbers and no pointer, and changes how later blocks are allocated, not any block there is.
    // It is not safe to call while other threads allocate (mallopt(3), "MT-Unsafe init"): the program calls it first of all.
    // A refusal (0) leaves things as they were, and only memory is at stake.
    let _accepted = unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, MAPPED_BYTES) };
}

/// Nothing is set where the C library is another one.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn return_large_blocks() {}

/// Gives memory back that is free, also between blocks that stay: what the survey knew of cells before they were packed lies
/// between what stays of it, 4 MiB for 16 km of street.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(unsafe_code, reason = "a request to the C library can only be made by an unsafe call")]
pub(crate) fn return_free_memory() {
    // SAFETY: malloc_trim takes a number, locks the heaps that it looks at ("MT-Safe", malloc_trim(3)), and gives back
    // pages that no block lies on. What it returns, whether there were any, does not matter.
    let _any = unsafe { libc::malloc_trim(0) };
}

/// Nothing is asked for where the C library is another one.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn return_free_memory() {}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[cfg(test)]
mod tests {
    use std::hint::black_box;
    use std::ops::Range;

    const MIB: usize = 1 << 20;

    fn addresses<T>(block: &[T]) -> Range<usize> {
        let from = block.as_ptr().addr();
        from..from + size_of_val(block)
    }

    /// Bytes of a range of addresses that belong to the process.
    fn mapped(range: &Range<usize>) -> usize {
        let maps = std::fs::read_to_string("/proc/self/maps").expect("a list of mappings");
        let ends = |line: &str| {
            let (from, to) = line.split_whitespace().next()?.split_once('-')?;
            Some((usize::from_str_radix(from, 16).ok()?, usize::from_str_radix(to, 16).ok()?))
        };
        maps.lines()
            .filter_map(ends)
            .map(|(from, to)| to.min(range.end).saturating_sub(from.max(range.start)))
            .sum()
    }

    /// Bytes of this process that are in memory and no file's.
    fn resident() -> usize {
        let status = std::fs::read_to_string("/proc/self/status").expect("a status");
        let line = status.lines().find(|line| line.starts_with("RssAnon:")).expect("a size");
        line.split_whitespace().nth(1).and_then(|kib| kib.parse::<usize>().ok()).expect("a number") << 10
    }

    #[test]
    fn what_is_free_between_blocks_that_stay_goes_back_to_the_system() {
        // Every other one of 2,000 blocks of 32 KiB, which makes 31 MiB.
        let pages: Vec<Vec<u8>> = (0..2_000).map(|_| black_box(vec![1_u8; MIB / 32])).collect();
        let (stay, go): (Vec<_>, Vec<_>) = pages.into_iter().enumerate().partition(|(n, _)| n % 2 == 0);
        let before = resident();
        drop(go);
        super::return_free_memory();
        let after = resident();
        assert!(after + 24 * MIB < before, "{after} of {before} bytes left");
        drop(black_box(stay));
    }

    #[test]
    fn a_large_block_goes_back_to_the_system_also_below_a_small_one_that_stays() {
        super::return_large_blocks();
        // A worker has a heap of its own, and a block that was freed is what raises the limit.
        let worker = std::thread::spawn(|| {
            drop(black_box(vec![1_u8; 24 * MIB]));
            let column = black_box(vec![1_u8; 16 * MIB]);
            let stays = black_box(vec![1_u8; MIB / 16]);
            let place = addresses(&column);
            assert_eq!(mapped(&place), 16 * MIB);
            drop(column);
            // Another thread may have been given some of these addresses meanwhile, but not half of them.
            assert!(mapped(&place) < 8 * MIB, "{} bytes below {:p}", mapped(&place), stays.as_ptr());
        });
        worker.join().expect("no panic");
    }
}
