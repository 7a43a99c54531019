//! `--version` and `info`.

use std::io::Write;
use std::process::ExitCode;

use radiosa::math::CpuPath;
use serde_json::json;

use crate::args::Info;
use crate::error::Error;

/// Version, commit (when built from a checkout), features and the CPU path taken.
pub(crate) fn print(json: bool) {
    let version = env!("CARGO_PKG_VERSION");
    let text = if json {
        let commit = option_env!("RADIOSA_COMMIT");
        json!({ "version": version, "commit": commit, "features": [], "cpu_path": CpuPath::detect().to_string() }).to_string()
    } else {
        format!("radiosa {version}")
    };
    say(&text);
}

/// A line on standard output; a reader that has gone away is no error of ours.
pub(crate) fn say(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// Prints the recipe inside a picture or a solution.
pub(crate) fn info(info: &Info, json: bool) -> Result<ExitCode, Error> {
    let is_solution = info.file.extension().is_some_and(|e| e.eq_ignore_ascii_case("radiosa"));
    let recipe = if is_solution {
        radiosa::export::solution::open(&info.file, radiosa::export::solution::HEAD)?.recipe().clone()
    } else {
        radiosa::export::image::read_recipe(&info.file)?
    };
    if json {
        let map: serde_json::Map<_, _> = recipe.entries().iter().map(|(k, v)| (k.clone(), v.as_str().into())).collect();
        say(&serde_json::Value::Object(map).to_string());
    } else {
        for (key, value) in recipe.entries() {
            say(&format!("{key}: {value}"));
        }
    }
    Ok(ExitCode::SUCCESS)
}
