//! Wall and processor time, and medians.

use std::time::Instant;

/// Milliseconds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Time {
    pub wall: f64,
    /// User and system time of all threads of the process.
    pub processor: f64,
}

/// What several turns took.
#[derive(Debug, Default)]
pub struct Times(Vec<Time>);

impl Times {
    pub fn push(&mut self, time: Time) {
        self.0.push(time);
    }

    /// Of each on its own; there must be some.
    pub fn median(&self) -> Time {
        let of = |f: fn(&Time) -> f64| {
            let mut values: Vec<f64> = self.0.iter().map(f).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        };
        Time { wall: of(|t| t.wall), processor: of(|t| t.processor) }
    }
}

/// Runs something, and how long it took.
pub fn time<T>(f: impl FnOnce() -> T) -> (T, Time) {
    let (start, processor) = (Instant::now(), processor_time());
    let value = f();
    (value, Time { wall: 1e3 * start.elapsed().as_secs_f64(), processor: processor_time() - processor })
}

/// Processor time of all threads of this process, milliseconds.
fn processor_time() -> f64 {
    #[repr(C)]
    struct Timespec {
        seconds: i64,
        nanoseconds: i64,
    }
    unsafe extern "C" {
        fn clock_gettime(clock: i32, time: *mut Timespec) -> i32;
    }
    const PROCESS: i32 = 2;
    let mut t = Timespec { seconds: 0, nanoseconds: 0 };
    // SAFETY: the structure has the layout of 64-bit Linux.
    unsafe { clock_gettime(PROCESS, &mut t) };
    1e3 * t.seconds as f64 + 1e-6 * t.nanoseconds as f64
}
