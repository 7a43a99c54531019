//! Runs the command as somebody would type it.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;

/// What it says and how it ends, in a folder.
pub(crate) fn radiosa(dir: &Path, args: &[&str]) -> Output {
    let mut command = Command::cargo_bin("radiosa").expect("the command is built");
    command.current_dir(dir).env("NO_COLOR", "1").env("COLUMNS", "100").args(args).output().expect("it runs")
}

/// What was said.
pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
