//! The command `radiosa`.

#![deny(clippy::print_stdout, clippy::print_stderr)]

mod args;
mod error;
mod factors;
mod false_color;
mod interrupt;
mod measure;
mod progress;
mod render;
mod scenes;
mod sheet;
mod solve;
mod version;

use std::process::ExitCode;

fn main() -> ExitCode {
    let args = args::Arguments::read();
    let json = args.json;
    match run(args) {
        Ok(code) => code,
        Err(error) => {
            error.report(json);
            error.exit_code()
        }
    }
}

fn run(args: args::Arguments) -> Result<ExitCode, error::Error> {
    if args.version {
        version::print(args.json);
        return Ok(ExitCode::SUCCESS);
    }
    match args.verb {
        Some(args::Verb::Render(render)) => render::run(&render, args.json),
        Some(args::Verb::Sheet(sheet)) => sheet::run(&sheet, args.json),
        Some(args::Verb::Solve(solve)) => solve::run(&solve, args.json),
        Some(args::Verb::Measure(measure)) => measure::run(&measure, args.json),
        Some(args::Verb::Factors(factors)) => factors::run(&factors, args.json),
        Some(args::Verb::Scenes(scenes)) => scenes::run(scenes, args.json),
        Some(args::Verb::Info(info)) => version::info(&info, args.json),
        None => {
            use clap::CommandFactory;
            let mut command = args::Arguments::command();
            Err(error::Error::Silence(command.render_help().to_string()))
        }
    }
}
