//! How much memory decoding may still take.

use super::super::ImportError;

/// Counts what is decoded against the allowance.
#[derive(Debug)]
pub(super) struct Budget {
    used: u64,
    allowed: u64,
}

impl Budget {
    /// Nothing used yet.
    pub(super) fn new(allowed: u64) -> Self {
        Self { used: 0, allowed }
    }

    /// Takes `bytes` for something, before it is allocated.
    pub(super) fn reserve(&mut self, what: &dyn Fn() -> String, bytes: u64) -> Result<(), ImportError> {
        let needed = self.used.saturating_add(bytes);
        if needed > self.allowed {
            let what = format!("decoding {} (with everything before it)", what());
            return Err(ImportError::TooLarge { what, needed, allowed: self.allowed });
        }
        self.used = needed;
        Ok(())
    }

    /// What is left.
    pub(super) fn left(&self) -> u64 {
        self.allowed - self.used
    }
}
