//! What went wrong, for a person: what, where, what to try.

use std::io::Write;
use std::process::ExitCode;

use miette::{Diagnostic, GraphicalReportHandler, LabeledSpan, NamedSource};
use radiosa::export::ExportError;
use radiosa::film::FilmError;
use radiosa::import::ImportError;
use radiosa::scanline::ScanLineError;
use radiosa::scene::SceneError;

/// Everything that ends the command early.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// The words on the command line do not fit together; exit code 2.
    #[error("{0}")]
    Misuse(String),
    /// There were none, and this is the help; exit code 2.
    #[error("{0}")]
    Silence(String),
    /// Something else was asked for that cannot be done.
    #[error("{message}")]
    Failed { message: String, help: String },
    #[error(transparent)]
    Import(#[from] ImportError),
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Film(#[from] FilmError),
    #[error(transparent)]
    ScanLine(#[from] ScanLineError),
    #[error(transparent)]
    Export(#[from] ExportError),
}

impl Error {
    pub(crate) fn failed(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Failed { message: message.into(), help: help.into() }
    }

    pub(crate) fn exit_code(&self) -> ExitCode {
        ExitCode::from(if matches!(self, Self::Misuse(_) | Self::Silence(_)) { 2 } else { 1 })
    }

    fn help_text(&self) -> &str {
        match self {
            Self::Failed { help, .. } => help,
            Self::Import(e) => e.help(),
            Self::Export(e) => e.help(),
            _ => "",
        }
    }

    /// One message on standard error; with `--json` also an object on standard output.
    pub(crate) fn report(&self, json: bool) {
        let mut text = String::new();
        let shown = Shown::new(self);
        let width = terminal_width();
        let handler = if colour() { GraphicalReportHandler::new() } else { GraphicalReportHandler::new_themed(plain()) };
        if let Self::Silence(help) = self {
            text.clone_from(help);
        } else if matches!(self, Self::Misuse(_)) || handler.with_width(width).render_report(&mut text, &shown).is_err() {
            text = format!("error: {self}\n");
        }
        // If standard error is gone there is nobody to tell.
        let _ = write!(std::io::stderr(), "{text}");
        if json {
            let at = match self {
                Self::Import(e) => e.location().map(ToString::to_string),
                _ => None,
            };
            let object = serde_json::json!({ "error": { "message": self.to_string(), "at": at, "help": self.help_text() } });
            crate::version::say(&object.to_string());
        }
    }
}

fn colour() -> bool {
    use std::io::IsTerminal;
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
}

fn plain() -> miette::GraphicalTheme {
    use std::io::IsTerminal;
    if std::io::stderr().is_terminal() { miette::GraphicalTheme::unicode_nocolor() } else { miette::GraphicalTheme::none() }
}

fn terminal_width() -> usize {
    std::env::var("COLUMNS").ok().and_then(|v| v.parse().ok()).unwrap_or(110)
}

/// An error as the reporter wants it: message, source text with a caret, advice.
#[derive(Debug)]
struct Shown {
    message: String,
    help: String,
    source: Option<NamedSource<String>>,
    span: Option<std::ops::Range<usize>>,
}

impl Shown {
    fn new(error: &Error) -> Self {
        let mut shown = Self { message: error.to_string(), help: error.help_text().to_owned(), source: None, span: None };
        if let Error::Import(e) = error
            && let Some(at) = e.location()
        {
            match &at.excerpt {
                Some((text, span)) => {
                    shown.source = Some(NamedSource::new(at.path.display().to_string(), text.to_string()));
                    shown.span = Some(span.clone());
                }
                None => shown.message = format!("{at}: {}", shown.message),
            }
        }
        shown
    }
}

impl std::fmt::Display for Shown {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Shown {}

impl Diagnostic for Shown {
    fn help<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        (!self.help.is_empty()).then(|| Box::new(&self.help) as Box<dyn std::fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        self.source.as_ref().map(|s| s as &dyn miette::SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let span = self.span.clone()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(Some("here".into()), span))))
    }
}
