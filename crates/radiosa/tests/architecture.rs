//! The layers of the library: a module may use those below it, never those above, and the method folders do not know each other.

use std::path::{Path, PathBuf};

/// Modules by layer, lowest first (`ARCHITECTURE.md` explains them).
const LAYERS: [&[&str]; 7] = [
    &["math", "spectrum", "radiometry", "sampling", "stream"],
    &["scene", "import", "film"],
    &["accel", "raster", "bsdf", "emitter"],
    &["transport"],
    &["scanline", "raytrace", "radiosity"],
    &["hybrid"],
    &["measure", "export"],
];

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|names| names.contains(&module))
}

fn rust_files(dir: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).expect("the source folder is readable") {
        let path = entry.expect("its entries too").path();
        if path.is_dir() {
            rust_files(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

/// The top-level modules a source text uses through `crate::`, outside of comments.
fn used_modules(text: &str) -> Vec<String> {
    text.lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .flat_map(|line| line.split("crate::").skip(1))
        .map(|rest| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect())
        .collect()
}

fn violations(module: &str, text: &str) -> Vec<String> {
    let Some(own) = layer(module) else { return vec![format!("{module} is in no layer")] };
    used_modules(text)
        .into_iter()
        .filter(|used| match layer(used) {
            Some(other) => other > own || (own == 4 && other == 4 && used != module),
            None => false,
        })
        .map(|used| format!("{module} uses {used}"))
        .collect()
}

#[test]
fn no_module_uses_a_higher_layer() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    let mut found = Vec::new();
    for file in files {
        let relative = file.strip_prefix(&src).expect("it was found below");
        let module = relative.components().next().expect("it has a name").as_os_str().to_string_lossy();
        let module = module.trim_end_matches(".rs");
        if module == "lib" {
            continue;
        }
        let text = std::fs::read_to_string(&file).expect("source files are text");
        found.extend(violations(module, &text).into_iter().map(|v| format!("{}: {v}", relative.display())));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn the_rule_catches_a_wrong_arrow() {
    assert_eq!(violations("scene", "use crate::transport::World;"), ["scene uses transport"]);
    assert!(violations("transport", "use crate::scene::Scene; // crate::export").is_empty());
}
