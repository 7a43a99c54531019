//! The verb `scenes`.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use radiosa::import::sample;

use crate::args::{Scenes, ScenesAction};
use crate::error::Error;
use crate::version::say;

pub(crate) fn run(scenes: Scenes, json: bool) -> Result<ExitCode, Error> {
    match scenes.action {
        None => {
            let list = sample::list();
            if json {
                let list: Vec<_> = list.iter().map(|s| serde_json::json!({ "name": s.name, "about": s.about })).collect();
                say(&serde_json::json!({ "scenes": list }).to_string());
            } else {
                for scene in list {
                    say(&format!("{:<16} {}", scene.name, scene.about));
                }
            }
        }
        Some(ScenesAction::Export { name, output, force }) => {
            let text = sample::get(&name).ok_or_else(|| unknown(&name))?.toml;
            let output = output.unwrap_or_else(|| PathBuf::from(format!("{name}.toml")));
            if output.exists() && !force {
                return Err(Error::failed(
                    format!("{} exists already", output.display()),
                    "choose another name with --output, or replace it with --force",
                ));
            }
            // The schema lies in the source tree only.
            let text: String = text.lines().filter(|l| !l.starts_with("#:schema")).map(|l| format!("{l}\n")).collect();
            radiosa::export::write_atomically(&output, |file| file.write_all(text.as_bytes()))?;
            if json {
                say(&serde_json::json!({ "outputs": [output] }).to_string());
            } else {
                say(&output.display().to_string());
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// A name that is neither a built-in scene nor a file.
pub(crate) fn unknown(name: &str) -> Error {
    let names: Vec<&str> = sample::list().iter().map(|s| s.name).collect();
    let near = sample::nearest(name).map(|n| format!("did you mean {n:?}? ")).unwrap_or_default();
    let built_in = names.join(", ");
    Error::failed(
        format!("there is no scene {name:?}"),
        format!("{near}Built-in scenes are {built_in}; files end in .{}", radiosa::import::ENDINGS.join(", .")),
    )
}
