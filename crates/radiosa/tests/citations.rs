//! Every paper cited in the code as `[Key]` is listed in `docs/references.bib`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Citation keys in a text: a bracket around a capitalised name and, for papers, two digits of the year.
fn keys(text: &str) -> impl Iterator<Item = &str> {
    text.match_indices('[').filter_map(move |(at, _)| {
        let inside = &text[at + 1..];
        let key = &inside[..inside.find(']')?];
        let name = key.trim_end_matches(|c: char| c.is_ascii_digit());
        let is_key = key.len() == name.len() + 2 && name.len() > 2;
        let capitalised = name.starts_with(|c: char| c.is_ascii_uppercase()) && name.chars().all(|c| c.is_ascii_alphabetic());
        // A link `[Name](…)` or `[Name]:` is none.
        let after = &inside[key.len() + 1..];
        (is_key && capitalised && !after.starts_with(['(', ':', '['])).then_some(key)
    })
}

fn rust_files(dir: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).expect("a folder of the project").map(|entry| entry.expect("readable").path()) {
        if entry.is_dir() {
            rust_files(&entry, found);
        } else if entry.extension().is_some_and(|e| e == "rs") {
            found.push(entry);
        }
    }
}

#[test]
fn every_citation_has_an_entry() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let bib = std::fs::read_to_string(root.join("docs/references.bib")).expect("the list of references");
    let mut files = Vec::new();
    rust_files(&root.join("crates/radiosa/src"), &mut files);
    let mut cited: BTreeMap<String, PathBuf> = BTreeMap::new();
    for file in files {
        let text = std::fs::read_to_string(&file).expect("source text");
        cited.extend(keys(&text).map(|key| (key.to_owned(), file.clone())));
    }
    assert!(cited.len() > 15, "found only {cited:?}");
    let missing: Vec<_> = cited.iter().filter(|(key, _)| !bib.contains(&format!("{{{key},"))).collect();
    assert!(missing.is_empty(), "not in docs/references.bib: {missing:?}");
}

#[test]
fn keys_are_told_from_links() {
    assert_eq!(keys("see [Cook82] and [Vec3], [`x`], [Foo12](bar), a[i]").collect::<Vec<_>>(), ["Cook82"]);
}
