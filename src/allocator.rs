//! Settings of the C library's allocator: large freed blocks are returned to the system at once.
//!
//! A tile consists of a few dozen columns of megabytes that live for a second. At first, glibc maps each
//! block of at least 128 KiB separately. It raises this limit to the size of each such block that is freed,
//! up to 32 MiB (mallopt(3), `M_MMAP_THRESHOLD`). After the first tiles, columns therefore come from the heap
//! of the worker, and freed memory stays there as long as any block above it is in use. The memory of one
//! worker grew from tile to tile in this way: from 50 to 105 MiB over a drive of 4 km with tiles of 30 to 70
//! MiB. A limit that is set explicitly does not rise. It follows the memory budget, because a block that
//! returned to the system must be faulted in again when it is needed.

/// Smallest size in bytes of blocks that are mapped separately when memory is scarce. Chosen, because only
/// the columns of cells of a tile are smaller, and because there are few buffers for a block of records
/// (about 1 MB and more).
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LEAST_MAPPED_BYTES: libc::c_int = 1 << 20;
/// The largest limit that glibc accepts: half of the largest heap of a thread (mallopt(3)).
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const MOST_MAPPED_BYTES: libc::c_int = 32 << 20;
/// A block is mapped separately if it has at least one part in this many of the memory budget (chosen: with
/// this share, runs within 400 MB to 4 GB take the same memory as with the smallest limit, within a few
/// percent).
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const MAPPED_SHARE: u64 = 256;

/// Makes large blocks return to the system when they are freed. Must be called while there is only one
/// thread.
pub(crate) fn return_large_blocks() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    set(libc::M_MMAP_THRESHOLD, LEAST_MAPPED_BYTES);
}

/// Keeps freed blocks that are small compared with the memory budget (in bytes) for the next use. Mapping a
/// block again for each use costs a page fault for every 4 KiB. The free memory at the end of a heap may be
/// twice as large as such a block, as when glibc raises the limit itself. Must be called while no other
/// thread allocates.
pub(crate) fn keep_blocks_within(budget: u64) {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        let bytes = limit_within(budget);
        if bytes > LEAST_MAPPED_BYTES {
            set(libc::M_MMAP_THRESHOLD, bytes);
            set(libc::M_TRIM_THRESHOLD, 2 * bytes);
        }
    }
    #[cfg(not(all(target_os = "linux", target_env = "gnu")))]
    let _nothing_to_set = budget;
}

/// The limit for a memory budget, in bytes.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn limit_within(budget: u64) -> libc::c_int {
    let share = libc::c_int::try_from(budget / MAPPED_SHARE).unwrap_or(MOST_MAPPED_BYTES);
    share.clamp(LEAST_MAPPED_BYTES, MOST_MAPPED_BYTES)
}

/// Sets a parameter of the allocator, in bytes.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(unsafe_code, reason = "a setting of the C library can only be made by an unsafe call")]
fn set(parameter: libc::c_int, bytes: libc::c_int) {
    // SAFETY: mallopt takes two numbers and no pointer. It changes how later blocks are allocated, and no
    // existing block. It is not safe while other threads allocate (mallopt(3), "MT-Unsafe init"), so the
    // program calls it before it starts any thread that does. A refusal (0) changes nothing and only costs
    // memory.
    let _accepted = unsafe { libc::mallopt(parameter, bytes) };
}

/// Returns free memory to the system, including the memory between blocks in use. The counts of the survey
/// before packing lie between blocks that remain: 4 MiB for 16 km of street.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(unsafe_code, reason = "a request to the C library can only be made by an unsafe call")]
pub(crate) fn return_free_memory() {
    // SAFETY: malloc_trim takes a number, locks the heaps that it examines ("MT-Safe", malloc_trim(3)), and
    // releases only pages without a block. The return value (whether any was released) does not matter.
    let _any = unsafe { libc::malloc_trim(0) };
}

/// Other C libraries: nothing to do.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn return_free_memory() {}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[cfg(test)]
mod tests {
    use std::hint::black_box;
    use std::ops::Range;
    use std::sync::{Mutex, PoisonError};

    /// The tests measure the memory of the whole process, so each waits for the other.
    static ALONE: Mutex<()> = Mutex::new(());

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

    /// Bytes of memory of this process that do not belong to a file.
    fn resident() -> usize {
        let status = std::fs::read_to_string("/proc/self/status").expect("a status");
        let line = status.lines().find(|line| line.starts_with("RssAnon:")).expect("a size");
        line.split_whitespace().nth(1).and_then(|kib| kib.parse::<usize>().ok()).expect("a number") << 10
    }

    #[test]
    fn free_memory_between_blocks_in_use_returns_to_the_system() {
        let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        // Every second one of 2,000 blocks of 32 KiB is freed: 31 MiB.
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
    fn the_limit_is_a_share_of_the_budget_within_what_the_c_library_takes() {
        let mebibytes = |budget: u64| super::limit_within(budget << 20) >> 20;
        assert_eq!([16, 300, 1024, 4096, 8192, 1 << 20].map(mebibytes), [1, 1, 4, 16, 32, 32]);
    }

    #[test]
    fn a_large_block_returns_to_the_system_even_below_a_small_one_in_use() {
        let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        super::return_large_blocks();
        // A worker has its own heap. Freeing a large block raises the limit.
        let worker = std::thread::spawn(|| {
            drop(black_box(vec![1_u8; 24 * MIB]));
            let column = black_box(vec![1_u8; 16 * MIB]);
            let stays = black_box(vec![1_u8; MIB / 16]);
            let place = addresses(&column);
            assert_eq!(mapped(&place), 16 * MIB);
            drop(column);
            // Another thread may have received some of these addresses, but not half of them.
            assert!(mapped(&place) < 8 * MIB, "{} bytes below {:p}", mapped(&place), stays.as_ptr());
        });
        worker.join().expect("no panic");
    }
}
