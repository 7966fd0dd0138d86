//! Counts the memory of all units in flight, and makes units wait for memory.

use std::sync::{Condvar, Mutex, PoisonError};

/// Bytes that all units in flight need together.
#[derive(Debug, Default)]
pub(crate) struct InFlight {
    bytes: Mutex<u64>,
    landed: Condvar,
}

impl InFlight {
    /// Waits until `bytes` more fit into `memory`, or until nothing else is in flight. A unit that never fits
    /// runs alone.
    pub(crate) fn start(&self, bytes: u64, memory: u64) {
        let flying = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        let full = |flying: &mut u64| *flying > 0 && flying.saturating_add(bytes) > memory;
        let mut flying = self.landed.wait_while(flying, full).unwrap_or_else(PoisonError::into_inner);
        *flying = flying.saturating_add(bytes);
    }

    /// Releases the bytes of a unit.
    pub(crate) fn land(&self, bytes: u64) {
        *self.bytes.lock().unwrap_or_else(PoisonError::into_inner) -= bytes;
        self.landed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering::SeqCst};
    use std::time::Duration;

    use crossbeam_channel::bounded;

    use super::*;

    #[test]
    fn units_fly_together_only_within_the_memory_and_the_largest_alone() {
        let units = [60, 40, 50, 200, 10, 30, 60, 100, 1, 150, 50, 50];
        let flight = InFlight::default();
        let flying = AtomicU64::new(0);
        let together = AtomicU64::new(0);
        let (jobs, inbox) = bounded::<u64>(0);
        std::thread::scope(|scope| {
            for _ in 0..3 {
                let inbox = inbox.clone();
                scope.spawn(|| {
                    for bytes in inbox {
                        let others = flying.fetch_add(bytes, SeqCst);
                        assert!(others == 0 || others + bytes <= 100, "{others} and {bytes}");
                        together.fetch_add(u64::from(others > 0), SeqCst);
                        std::thread::sleep(Duration::from_millis(20));
                        flying.fetch_sub(bytes, SeqCst);
                        flight.land(bytes);
                    }
                });
            }
            for bytes in units {
                flight.start(bytes, 100);
                jobs.send(bytes).unwrap();
            }
            drop((jobs, inbox));
        });
        // 40 with 60, 30 and 60 with 10, 50 with 50: at least some of these are in flight together.
        assert!(together.load(SeqCst) > 1, "nothing flew together");
        assert_eq!(*flight.bytes.lock().unwrap(), 0);
    }
}
