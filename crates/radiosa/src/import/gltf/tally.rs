//! Oddities that may occur a thousand times in a file and are worth one warning.

use std::path::Path;

use super::super::Warnings;

/// Counts occurrences by kind.
#[derive(Debug, Default)]
pub(super) struct Tally {
    entries: Vec<Entry>,
}

#[derive(Debug)]
struct Entry {
    name: &'static str,
    what: &'static str,
    count: u64,
    first: String,
}

impl Tally {
    /// Notes `count` occurrences of something at a place; `what` reads on from a number, such as `primitives of points are ignored`.
    pub(super) fn note(&mut self, name: &'static str, what: &'static str, count: u64, place: &str) {
        match self.entries.iter_mut().find(|e| e.name == name && e.what == what) {
            Some(entry) => entry.count += count,
            None => self.entries.push(Entry { name, what, count, first: place.to_owned() }),
        }
    }

    /// Turns them into warnings.
    pub(super) fn report(self, file: &Path, warnings: &mut Warnings) {
        for Entry { name, what, count, first } in self.entries {
            warnings.add(name, file, format!("{what}: {count} times, first at {first}"));
        }
    }
}
