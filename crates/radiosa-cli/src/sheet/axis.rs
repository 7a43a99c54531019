//! What changes from cell to cell: parameters and their values.

use clap::{Args, Command, FromArgMatches};
use radiosa::film::Layer;
use radiosa::import::{self, Override};

use crate::args::Picture;
use crate::error::Error;

/// One side of a sheet.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    /// The parameter, for the title; empty when there is none.
    pub(crate) what: String,
    pub(crate) entries: Vec<Entry>,
}

/// One row or one column.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) label: String,
    pub(crate) changes: Vec<Change>,
}

/// What one cell shows.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    pub(crate) scene: String,
    pub(crate) layer: Layer,
    pub(crate) picture: Picture,
}

/// One parameter with a value.
#[derive(Clone, Debug)]
pub(crate) enum Change {
    Scene(String),
    Layer(Layer),
    /// An option of a picture.
    Option {
        name: String,
        value: String,
    },
    Set(Override),
}

impl Axis {
    /// A side along which nothing changes.
    pub(crate) fn none() -> Self {
        Self { what: String::new(), entries: vec![Entry { label: String::new(), changes: Vec::new() }] }
    }

    /// From `PARAM=V1,V2,…`.
    ///
    /// # Errors
    /// When there are no values, or nothing is called so.
    pub(crate) fn parse(text: &str, name: Option<&str>) -> Result<Self, Error> {
        let (parameter, values) = text
            .split_once('=')
            .filter(|(p, v)| !p.trim().is_empty() && !v.trim().is_empty())
            .ok_or_else(|| Error::Misuse(format!("{text:?} has no values: write PARAM=V1,V2,…")))?;
        let values = split(values).map_err(|open| {
            Error::Misuse(format!(
                "{text:?} opens {open:?} and does not close it: write a value that has commas as [0.1,0.2,0.3]"
            ))
        })?;
        Self::new(parameter.trim(), name, &values)
    }

    /// A parameter and its values.
    pub(crate) fn new(parameter: &str, name: Option<&str>, values: &[String]) -> Result<Self, Error> {
        let name = name.unwrap_or_else(|| parameter.rsplit('.').next().unwrap_or(parameter));
        let entry = |value: &String| {
            let is_word = value.starts_with(|c: char| c.is_alphabetic()) || matches!(parameter, "scene" | "layer");
            let label = if is_word { value.clone() } else { format!("{name} = {value}") };
            Ok(Entry { label, changes: vec![Change::new(parameter, value)?] })
        };
        Ok(Self { what: parameter.to_owned(), entries: values.iter().map(entry).collect::<Result<_, Error>>()? })
    }
}

/// Values between commas; commas within brackets, braces and quotes belong to a value. An error is what was opened and not closed.
fn split(text: &str) -> Result<Vec<String>, char> {
    let (mut parts, mut open, mut quote) = (vec![String::new()], Vec::new(), None);
    for c in text.chars() {
        let begins = parts.last().is_none_or(|part| part.trim().is_empty());
        match (c, quote) {
            (',', None) if open.is_empty() => {
                parts.push(String::new());
                continue;
            }
            ('[' | '{', None) => open.push(c),
            (']' | '}', None) => {
                open.pop();
            }
            // Within a word it is an apostrophe.
            ('"' | '\'', None) if begins || !open.is_empty() => quote = Some(c),
            (c, Some(q)) if c == q => quote = None,
            _ => {}
        }
        if let Some(last) = parts.last_mut() {
            last.push(c);
        }
    }
    match quote.or(open.pop()) {
        Some(open) => Err(open),
        None => Ok(parts.iter().map(|p| p.trim().to_owned()).collect()),
    }
}

impl Change {
    /// A parameter and a value as they are written.
    ///
    /// # Errors
    /// When nothing is called so, or the value can be seen not to fit.
    pub(crate) fn new(parameter: &str, value: &str) -> Result<Self, Error> {
        let misfit = |message: String, help: String| Error::failed(message, help);
        match parameter {
            "scene" => Ok(Self::Scene(value.to_owned())),
            "layer" => {
                let layers = || {
                    let light = Layer::ALL.into_iter().filter(|l| l.channels().len() == 3);
                    light.map(Layer::name).collect::<Vec<_>>().join(", ")
                };
                let layer = value.parse::<Layer>().ok().filter(|l| l.channels().len() == 3);
                let message = || format!("there is no layer {value:?} that can be shown");
                layer.map(Self::Layer).ok_or_else(|| misfit(message(), format!("known here: {}", layers())))
            }
            _ if options().any(|o| o == parameter) => Ok(Self::Option { name: parameter.to_owned(), value: value.to_owned() }),
            _ if parameter.contains('.') => {
                Override::new(parameter, value).map(Self::Set).map_err(|e| misfit(e.to_string(), String::new()))
            }
            _ => {
                let known: Vec<String> = options().chain(["scene".to_owned(), "layer".to_owned()]).collect();
                let help = match import::nearest(parameter, known.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean {near:?}?"),
                    None => {
                        format!("give a path into the scene file, such as light.key.intensity, or one of {}", known.join(", "))
                    }
                };
                Err(misfit(format!("there is no parameter {parameter:?}"), help))
            }
        }
    }

    /// The option it gives a value.
    pub(crate) fn option(&self) -> Option<&str> {
        if let Self::Option { name, .. } = self { Some(name) } else { None }
    }

    /// True for an option with one of these names.
    pub(crate) fn is_one_of(&self, names: &[String]) -> bool {
        matches!(self, Self::Option { name, .. } if names.contains(name))
    }

    /// Makes a cell show it.
    ///
    /// # Errors
    /// When the value is none for this option.
    pub(crate) fn apply(&self, cell: &mut Cell) -> Result<(), Error> {
        match self {
            Self::Scene(name) => cell.scene.clone_from(name),
            Self::Layer(layer) => cell.layer = *layer,
            Self::Set(value) => cell.picture.scene.set.push(value.clone()),
            Self::Option { name, value } => {
                // Colours are written without brackets there.
                let value = value.strip_prefix('[').and_then(|v| v.strip_suffix(']')).unwrap_or(value);
                // Without defaults: what is not given stays as it is.
                let mut command =
                    picture_command().no_binary_name(true).mut_args(|a| a.default_value(clap::builder::Resettable::Reset));
                let update = command
                    .try_get_matches_from_mut([format!("--{name}={value}")])
                    .and_then(|matches| cell.picture.update_from_arg_matches(&matches));
                update.map_err(|e| {
                    let text = e.to_string();
                    let message: Vec<&str> =
                        text.lines().take_while(|l| !l.starts_with("For more") && !l.starts_with("Usage")).collect();
                    Error::failed(message.join(" ").trim_start_matches("error: ").trim().to_owned(), "")
                })?;
            }
        }
        Ok(())
    }
}

fn picture_command() -> Command {
    Picture::augment_args_for_update(Command::new("sheet"))
}

/// The options a cell may have of its own: all those of a picture but its size, which is that of all cells, and `set`, which paths stand for.
fn options() -> impl Iterator<Item = String> {
    let command = picture_command();
    let names: Vec<String> = command.get_arguments().filter_map(|a| a.get_long().map(str::to_owned)).collect();
    names.into_iter().filter(|n| n != "size" && n != "set")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_within_brackets_and_quotes_belong_to_a_value() {
        let parts = |text: &str| split(text).expect("all is closed");
        assert_eq!(parts("0, [0.1,0.2, 0.3],\"a,b\",x"), ["0", "[0.1,0.2, 0.3]", "\"a,b\"", "x"]);
        assert_eq!(parts("]],tom's.toml"), ["]]", "tom's.toml"]);
        assert_eq!(["0,[0.1,0.1", "{a=[1]", "\"a,b", "['a]"].map(split), [Err('['), Err('{'), Err('"'), Err('\'')]);
        assert!(matches!(Axis::parse("ambient=0,[0.1,0.1", None), Err(Error::Misuse(said)) if said.contains('[')));
    }

    #[test]
    fn an_unknown_parameter_names_the_nearest_one() {
        let Err(Error::Failed { message, help }) = Axis::parse("interpolaton=flat", None) else { panic!("it is unknown") };
        assert!(message.contains("interpolaton") && help.contains("\"interpolation\""), "{message} {help}");
        assert!(Axis::parse("layer=depth", None).is_err());
        assert!(Axis::parse("method", None).is_err());
    }

    #[test]
    fn an_option_changes_itself_alone() {
        #[derive(clap::Parser)]
        struct Line {
            #[command(flatten)]
            picture: Picture,
        }
        let line = <Line as clap::Parser>::parse_from(["x", "--spp", "9", "--seed", "3"]);
        let mut cell = Cell { scene: "room".into(), layer: Layer::Color, picture: line.picture };
        for change in Axis::parse("ambient=[0.1,0.2,0.3]", None).expect("known").entries[0].changes.iter() {
            change.apply(&mut cell).expect("it fits");
        }
        assert_eq!((cell.picture.spp, cell.picture.seed, cell.picture.scene.ambient), (Some(9), 3, Some([0.1, 0.2, 0.3])));
        let wrong = Change::new("spp", "many").expect("known");
        assert!(wrong.apply(&mut cell).is_err());
    }
}
