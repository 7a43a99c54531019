//! Whatever bytes an importer is given, it answers with a valid scene or an error that says something, soon.
#![expect(clippy::print_stderr, reason = "tests say what they skip")]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use proptest::prelude::*;
use proptest::sample::Index;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, TestRng, TestRunner};
use radiosa::import::{Options, load_bytes, sample};
use radiosa_testkit::{data_dir, shared_dir};

/// How long each format is tried. The cases are the same in every run; how many fit is not.
const TIME: Duration = Duration::from_secs(4);

/// The longest a single small document may take, in a test that shares its processor with others.
const PATIENCE: Duration = Duration::from_secs(5);

/// What an importer may allocate for one of these.
const MEMORY: u64 = 256 << 20;

/// One way to damage a document.
#[derive(Clone, Debug)]
enum Damage {
    /// Cut off there.
    Truncate(Index),
    /// One byte replaced.
    Set(Index, u8),
    /// One bit turned.
    Flip(Index, u8),
    /// A number in the text replaced by one that is unlikely there.
    Number(Index, &'static str),
    /// A stretch repeated in another place.
    Copy(Index, Index, u8),
    /// A stretch removed.
    Remove(Index, u8),
    /// A word of the document where another was.
    Swap(Index, Index),
}

const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "1",
    "255",
    "65536",
    "2147483647",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "1e308",
    "-1e-308",
    "0.5",
    "nan",
    "99999999999999999999999999",
];

fn damage() -> impl Strategy<Value = Vec<Damage>> {
    let one = prop_oneof![
        1 => any::<Index>().prop_map(Damage::Truncate),
        3 => (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Damage::Set(at, byte)),
        3 => (any::<Index>(), 0u8..8).prop_map(|(at, bit)| Damage::Flip(at, bit)),
        6 => (any::<Index>(), prop::sample::select(&NUMBERS[..])).prop_map(|(at, number)| Damage::Number(at, number)),
        2 => (any::<Index>(), any::<Index>(), any::<u8>()).prop_map(|(from, to, n)| Damage::Copy(from, to, n)),
        2 => (any::<Index>(), any::<u8>()).prop_map(|(at, n)| Damage::Remove(at, n)),
        4 => (any::<Index>(), any::<Index>()).prop_map(|(a, b)| Damage::Swap(a, b)),
    ];
    prop::collection::vec(one, 1..6)
}

/// The stretch of bytes of one kind that begins at or after `at`.
fn run(bytes: &[u8], at: usize, is_kind: impl Fn(u8) -> bool) -> Option<std::ops::Range<usize>> {
    let start = at + bytes[at..].iter().position(|&b| is_kind(b))?;
    let end = bytes[start..].iter().position(|&b| !is_kind(b)).map_or(bytes.len(), |n| start + n);
    Some(start..end)
}

fn apply(bytes: &mut Vec<u8>, damage: &Damage) {
    if bytes.is_empty() {
        return;
    }
    let len = bytes.len();
    let is_word = |b: u8| b.is_ascii_alphanumeric() || b"_-.".contains(&b);
    match damage {
        Damage::Truncate(at) => bytes.truncate(at.index(len)),
        Damage::Set(at, byte) => bytes[at.index(len)] = *byte,
        Damage::Flip(at, bit) => bytes[at.index(len)] ^= 1 << bit,
        Damage::Number(at, number) => {
            if let Some(range) = run(bytes, at.index(len), |b| b.is_ascii_digit() || b == b'.') {
                bytes.splice(range, number.bytes());
            }
        }
        Damage::Copy(from, to, n) => {
            let from = from.index(len);
            let piece = bytes[from..(from + usize::from(*n)).min(len)].to_vec();
            let to = to.index(len);
            bytes.splice(to..to, piece);
        }
        Damage::Remove(at, n) => {
            let at = at.index(len);
            bytes.drain(at..(at + usize::from(*n)).min(len));
        }
        Damage::Swap(a, b) => {
            if let (Some(a), Some(b)) = (run(bytes, a.index(len), is_word), run(bytes, b.index(len), is_word)) {
                let word = bytes[b].to_vec();
                bytes.splice(a, word);
            }
        }
    }
}

/// The content of files.
fn read(documents: &[PathBuf]) -> Vec<(PathBuf, Vec<u8>)> {
    documents.iter().map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
}

/// Damages documents for a while and gives each to the importer.
fn check(documents: &[(PathBuf, Vec<u8>)]) {
    assert!(!documents.is_empty());
    let config = Config { failure_persistence: None, ..Config::default() };
    let rng = TestRng::deterministic_rng(config.rng_algorithm);
    let mut runner = TestRunner::new_with_rng(config, rng);
    let strategy = (any::<Index>(), damage());
    let options = Options { max_memory: MEMORY, ..Options::default() };
    let start = Instant::now();
    let (mut n_loaded, mut n_refused) = (0u32, 0u32);
    while start.elapsed() < TIME {
        let (which, all) = strategy.new_tree(&mut runner).unwrap().current();
        let (path, whole) = &documents[which.index(documents.len())];
        let mut bytes = whole.clone();
        for one in &all {
            apply(&mut bytes, one);
        }
        let begin = Instant::now();
        let path = path.clone();
        let options = options.clone();
        let name = path.display().to_string();
        // A panic is told with the damage that caused it.
        let answer = std::panic::catch_unwind(move || load_bytes(&bytes, &path, &options));
        let answer = answer.unwrap_or_else(|_| panic!("{name} with {all:?} panics"));
        assert!(begin.elapsed() < PATIENCE, "{name} with {all:?} takes {:?}", begin.elapsed());
        match answer {
            Ok(_) => n_loaded += 1, // and has passed `Scene::validate`
            Err(error) => {
                assert!(!error.to_string().is_empty());
                n_refused += 1;
            }
        }
    }
    eprintln!("{n_loaded} damaged documents loaded, {n_refused} were refused");
    assert!(n_loaded > 0 && n_refused > 0, "damage must matter, but not always");
}

/// The files with an ending below a folder of the shared collection that are small enough to be damaged often.
fn collection(folder: &str, ending: &str) -> Vec<PathBuf> {
    fn walk(folder: &Path, ending: &str, found: &mut Vec<PathBuf>) {
        let mut entries: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
        entries.sort();
        for path in entries {
            if path.is_dir() {
                walk(&path, ending, found);
            } else if path.extension().is_some_and(|e| e == ending) && path.metadata().unwrap().len() < 20_000 {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    match shared_dir() {
        Some(shared) => walk(&shared.join(folder), ending, &mut found),
        None => eprintln!("skipped: no collection of scenes beside the checkout"),
    }
    found
}

#[test]
fn damaged_obj_files_are_answered() {
    let mut documents = vec![data_dir().join("cornell-box/cornell-box.obj")];
    documents.extend(collection("scenes/obj-features", "obj"));
    check(&read(&documents));
}

#[test]
fn damaged_gltf_files_are_answered() {
    let documents = collection("scenes/gltf-features", "gltf");
    if !documents.is_empty() {
        check(&read(&documents));
    }
}

#[test]
fn damaged_glb_files_are_answered() {
    let documents = collection("scenes/gltf-features", "glb");
    if !documents.is_empty() {
        check(&read(&documents));
    }
}

/// A scene file with the shapes and lights the built-in scenes do without.
const SCENE_FILE: &str = r#"
name = "everything"
quantity = "photometric"
up = "z"
scale = 0.01

[material.white]
lambert = [0.7, 0.7, 0.7]

[[shape]]
material = "white"
mesh = { positions = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]], faces = [[0, 1, 2, 3], [0, 1, 4]] }
transform = { translate = [1, 2, 3] }

[[shape]]
cylinder = { from = [0, 0, 0], to = [0, 0, 1], radius = 0.5, segments = 12, caps = false }

[[shape]]
cone = { from = [0, 0, 0], to = [0, 0, 1], radius = 0.5 }

[[shape]]
polygons = [[[0, 0, 0], [3, 0, 0], [3, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]]]
"#;

#[test]
fn damaged_scene_files_are_answered() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| (folder.path().join(format!("{name}.toml")), text.as_bytes().to_vec());
    let mut documents = vec![file("everything", SCENE_FILE)];
    documents.extend(sample::list().iter().map(|s| file(s.name, s.toml)));
    for (path, bytes) in &documents {
        load_bytes(bytes, path, &Options::default()).unwrap();
    }
    check(&documents);
}

#[test]
fn every_beginning_of_a_file_is_answered() {
    let mut documents = vec![data_dir().join("cornell-box/cornell-box.obj")];
    for ending in ["gltf", "glb"] {
        documents.extend(collection("scenes/gltf-features", ending).into_iter().take(2));
    }
    for path in documents {
        let bytes = std::fs::read(&path).unwrap();
        let step = bytes.len().div_ceil(500).max(1);
        for n in (0..bytes.len()).step_by(step) {
            if let Err(error) = load_bytes(&bytes[..n], &path, &Options::default()) {
                assert!(!error.to_string().is_empty());
            }
        }
    }
}

#[test]
fn unknown_endings_are_refused_with_those_known() {
    for name in ["scene", "scene.blend", ".obj", "scene.obj.bak"] {
        let error = load_bytes(b"v 0 0 0", Path::new(name), &Options::default()).unwrap_err();
        assert!(error.help().contains(".toml"), "{name}: {}", error.help());
    }
}
