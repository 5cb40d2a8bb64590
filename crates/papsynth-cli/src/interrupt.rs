//! Ctrl-C, and what else asks a program to end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::exit::{Complaint, Exit, Failure};

/// Whether the user asked to stop.
#[derive(Debug, Clone, Default)]
pub(crate) struct Interrupt {
    asked: Arc<AtomicBool>,
}

impl Interrupt {
    /// Watches for Ctrl-C. A second one ends the program at once: unfinished files bear no final name.
    pub(crate) fn watch() -> Result<Self, Failure> {
        let interrupt = Self::default();
        let asked = Arc::clone(&interrupt.asked);
        ctrlc::set_handler(move || {
            if asked.swap(true, Ordering::SeqCst) {
                std::process::exit(i32::from(Exit::Interrupted.code()));
            }
        })
        .map_err(|error| Failure::input(Complaint::new(format!("cannot watch for Ctrl-C: {error}"))))?;
        Ok(interrupt)
    }

    /// Set once the user asked to stop.
    pub(crate) fn flag(&self) -> &AtomicBool {
        &self.asked
    }
}
