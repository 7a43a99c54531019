//! Ctrl-C asks for what there is; a second one ends at once.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);
static INSTALLED: OnceLock<()> = OnceLock::new();

/// Starts to listen.
pub(crate) fn listen() {
    INSTALLED.get_or_init(|| {
        // Without a handler Ctrl-C simply ends the program, which is no reason to refuse to work.
        let _ = ctrlc::set_handler(|| {
            if ASKED.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        });
    });
}

/// True once somebody pressed it.
pub(crate) fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}
