//! Values of a scene file replaced by path before it is read: `material.ball.phong.diffuse = 0.3`.
//!
//! The document is changed as text, so that the order of the file, which means something, stays, and the reader checks new values as it checks
//! all others. What is replaced must be there, up to the name of a material, light, camera, texture or shape; below, a key that the file leaves
//! at its default can be given. Nothing new is named.

use std::str::FromStr;

use thiserror::Error;
use toml_edit::{DocumentMut, InlineTable, Item, Key, TableLike, Value};

use super::error::{nearest, suggestion};
use crate::import::{ImportError, Location};

/// The tables whose keys are names.
const NAMED: [(&str, &str); 4] = [("texture", "texture"), ("material", "material"), ("light", "light"), ("camera", "camera")];
/// A path has at most this many keys.
const DEPTH: usize = 16;

/// A value of a scene file that is to be another one. Written `PATH=VALUE`: keys with dots between them, where `shape.2` is the third shape and
/// `shape.NAME` the one of that name, and a value as TOML writes it; a bare word is a string.
#[derive(Clone, Debug)]
pub struct Override {
    keys: Vec<String>,
    path: String,
    value: Value,
}

impl Override {
    /// The keys with dots between them, as they were written.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// The value as TOML.
    pub fn value(&self) -> String {
        self.value.to_string().trim().to_owned()
    }
}

impl PartialEq for Override {
    fn eq(&self, other: &Self) -> bool {
        self.keys == other.keys && self.value() == other.value()
    }
}

impl std::fmt::Display for Override {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.path, self.value())
    }
}

/// Why a text is no [`Override`].
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum OverrideError {
    /// There is no `=`.
    #[error("{0:?} has no value: write PATH=VALUE, such as light.key.intensity=0.5")]
    NoValue(String),
    /// The part before it is no path.
    #[error(
        "{0:?} is no path: write keys with dots between them, such as material.ball.lambert, and quotes around keys with other characters"
    )]
    NoPath(String),
}

impl FromStr for Override {
    type Err = OverrideError;

    fn from_str(text: &str) -> Result<Self, OverrideError> {
        let (path, value) = text.split_once('=').ok_or_else(|| OverrideError::NoValue(text.to_owned()))?;
        Self::new(path, value)
    }
}

impl Override {
    /// From a path and a value apart.
    ///
    /// # Errors
    /// When the path is none.
    pub fn new(path: &str, value: &str) -> Result<Self, OverrideError> {
        let path = path.trim();
        let keys = Key::parse(path).ok().filter(|keys| keys.len() <= DEPTH && keys.iter().all(|k| !k.get().is_empty()));
        let keys = keys.ok_or_else(|| OverrideError::NoPath(path.to_owned()))?;
        let value = value.trim();
        Ok(Self {
            keys: keys.iter().map(|k| k.get().to_owned()).collect(),
            path: path.to_owned(),
            value: value.parse().unwrap_or_else(|_| Value::from(value)),
        })
    }

    /// For messages: a long value is cut.
    pub(in crate::import) fn shortened(&self) -> String {
        const MOST: usize = 60;
        let text = self.to_string();
        if text.chars().count() <= MOST { text } else { text.chars().take(MOST).chain("…".chars()).collect() }
    }

    /// The same path inside a file that only includes another: what has a name there is changed by the include.
    pub(in crate::import) fn inside_include(&self) -> Self {
        let named = matches!(self.keys.first().map(String::as_str), Some("material" | "object"));
        let mut keys = self.keys.clone();
        if named {
            keys.insert(0, "include".into());
        }
        Self { keys, ..self.clone() }
    }
}

/// The text with values replaced. A text that is no TOML comes back as it is: its reader says why, better.
///
/// # Errors
/// When a path leads nowhere.
pub(in crate::import) fn replace(text: &str, overrides: &[Override], at: &Location) -> Result<String, ImportError> {
    let Ok(mut document) = text.parse::<DocumentMut>() else { return Ok(text.to_owned()) };
    for one in overrides {
        let before = document.clone();
        set(document.as_table_mut(), &one.keys, &one.value, true).map_err(|astray| {
            let mut known = Vec::new();
            paths(before.as_table(), "", &mut known);
            let at = Location { pointer: Some(one.path.clone()), ..at.clone() };
            let help = nearest(&one.path, known.iter().map(String::as_str)).map_or_else(
                || suggestion(&astray.word, astray.known.iter().map(String::as_str)),
                |p| format!("did you mean {p:?}?"),
            );
            ImportError::invalid_with_help(at, astray.message, help)
        })?;
    }
    Ok(document.to_string())
}

/// Where a path leaves the document.
struct Astray {
    message: String,
    word: String,
    known: Vec<String>,
}

fn set(table: &mut dyn TableLike, keys: &[String], value: &Value, top: bool) -> Result<(), Astray> {
    let [key, rest @ ..] = keys else { return Ok(()) };
    if rest.is_empty() {
        match table.get_mut(key) {
            // In place, so that comments and lines stay where they were.
            Some(Item::Value(old)) => exchange(old, value),
            _ => drop(table.insert(key, Item::Value(value.clone()))),
        }
        return Ok(());
    }
    if top && let Some((_, what)) = NAMED.iter().find(|(k, _)| k == key) {
        let named = table.get(key).and_then(Item::as_table_like);
        let names: Vec<String> = named.map(|t| t.iter().map(|(k, _)| k.to_owned()).collect()).unwrap_or_default();
        if !names.contains(&rest[0]) {
            return Err(Astray {
                message: format!("the scene has no {what} {:?}", rest[0]),
                word: rest[0].clone(),
                known: names,
            });
        }
    }
    match table.get_mut(key) {
        None if top && key == "shape" => {
            Err(Astray { message: "the scene has no shapes".into(), word: key.clone(), known: Vec::new() })
        }
        None => {
            let mut inner = InlineTable::new();
            set(&mut inner, rest, value, false)?;
            table.insert(key, Item::Value(inner.into()));
            Ok(())
        }
        Some(item) => set_inside(item, key, rest, value),
    }
}

/// Another value with the white space and comments of the old one.
fn exchange(old: &mut Value, new: &Value) {
    let decor = old.decor().clone();
    *old = new.clone();
    *old.decor_mut() = decor;
}

/// Goes on below an item that is there.
fn set_inside(item: &mut Item, key: &str, rest: &[String], value: &Value) -> Result<(), Astray> {
    match item {
        Item::ArrayOfTables(all) => {
            let names: Vec<String> = all.iter().enumerate().map(|(i, t)| name_of(t, i)).collect();
            let at = position(&names, key, &rest[0])?;
            match all.get_mut(at) {
                Some(table) if rest.len() > 1 => set(table, &rest[1..], value, false),
                _ => Err(Astray {
                    message: format!("{key}.{} is a table: say which of its values", rest[0]),
                    word: String::new(),
                    known: Vec::new(),
                }),
            }
        }
        Item::Value(Value::Array(all)) => {
            let names: Vec<String> =
                all.iter().enumerate().map(|(i, v)| v.as_inline_table().map_or(i.to_string(), |t| name_of(t, i))).collect();
            let at = position(&names, key, &rest[0])?;
            match all.get_mut(at) {
                Some(element) if rest.len() == 1 => {
                    exchange(element, value);
                    Ok(())
                }
                Some(Value::InlineTable(table)) => set(table, &rest[1..], value, false),
                _ => Err(not_a_table(&format!("{key}.{}", rest[0]))),
            }
        }
        _ => match item.as_table_like_mut() {
            Some(table) => set(table, rest, value, false),
            None => Err(not_a_table(key)),
        },
    }
}

fn not_a_table(what: &str) -> Astray {
    Astray { message: format!("{what} is a value: there is nothing inside it"), word: String::new(), known: Vec::new() }
}

/// The name of an element of an array, or its number.
fn name_of(table: &dyn TableLike, i: usize) -> String {
    table.get("name").and_then(Item::as_str).map_or_else(|| i.to_string(), str::to_owned)
}

/// The element a key means: the first of that name, or that number from 0.
fn position(names: &[String], array: &str, key: &str) -> Result<usize, Astray> {
    let found = names.iter().position(|n| n == key).or_else(|| key.parse().ok().filter(|&i: &usize| i < names.len()));
    found.ok_or_else(|| Astray {
        message: format!("there is no {array} {key:?}: it has {}", names.len()),
        word: key.to_owned(),
        known: names.to_vec(),
    })
}

/// All paths of a document that lead to values, as many as are ever compared.
fn paths(table: &dyn TableLike, prefix: &str, out: &mut Vec<String>) {
    for (key, item) in table.iter() {
        if out.len() >= 4096 {
            return;
        }
        let path = if prefix.is_empty() { key.to_owned() } else { format!("{prefix}.{key}") };
        match item {
            Item::ArrayOfTables(all) => {
                all.iter().enumerate().for_each(|(i, t)| paths(t, &format!("{path}.{}", name_of(t, i)), out));
            }
            _ => match item.as_table_like() {
                Some(inner) => paths(inner, &path, out),
                None => out.push(path),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "\
# kept
ambient = 0.1

[material.ball] # first
phong = { diffuse = 0.5, exponent = 10 }

[material.\"a b\"]
lambert = 0.2

[[shape]]
name = \"globe\"
sphere = { center = [0, 1, 0], radius = 1 }
";

    fn replaced(overrides: &[&str]) -> Result<String, ImportError> {
        let overrides: Vec<Override> = overrides.iter().map(|o| o.parse().expect("they are well formed")).collect();
        replace(FILE, &overrides, &Location::default())
    }

    #[test]
    fn a_value_is_replaced_where_it_stands_and_nothing_else_changes() {
        let text = replaced(&["material.ball.phong.diffuse=[0.1, 0.2, 0.3]"]).unwrap();
        assert_eq!(text, FILE.replace("diffuse = 0.5", "diffuse = [0.1, 0.2, 0.3]"));
        let text =
            replaced(&["ambient=0.3", "shape.globe.sphere.center.1=2", "shape.0.sphere.radius=3", "material.\"a b\".lambert=1"])
                .unwrap();
        let expected = FILE.replace("ambient = 0.1", "ambient = 0.3").replace("lambert = 0.2", "lambert = 1");
        assert_eq!(text, expected.replace("[0, 1, 0], radius = 1", "[0, 2, 0], radius = 3"));
    }

    #[test]
    fn a_key_left_at_its_default_can_be_given_and_a_bare_word_is_a_string() {
        let text = replaced(&["material.ball.phong.specular=0.25", "shape.globe.material=ball", "background=0.5"]).unwrap();
        let file: toml::Table = text.parse().unwrap();
        assert_eq!(file["material"]["ball"]["phong"]["specular"].as_float(), Some(0.25));
        assert_eq!(file["shape"][0]["material"].as_str(), Some("ball"));
        assert_eq!(file["background"].as_float(), Some(0.5));
    }

    #[test]
    fn a_path_that_leads_nowhere_names_the_nearest_one() {
        for (path, said) in [
            ("material.bal.phong.diffuse=1", "material.ball.phong.diffuse"),
            ("shape.glob.sphere.radius=1", "shape.globe.sphere.radius"),
        ] {
            let error = replaced(&[path]).unwrap_err();
            assert!(error.help().contains(said), "{error}: {}", error.help());
        }
        for path in ["ambient.red=1", "shape.0=1", "shape.7.material=ball", "light.key.intensity=1", "shape.0.sphere.center.3=1"]
        {
            assert!(replaced(&[path]).is_err(), "{path}");
        }
    }

    #[test]
    fn what_is_no_path_or_has_no_value_is_said() {
        assert_eq!("ambient".parse::<Override>(), Err(OverrideError::NoValue("ambient".into())));
        for path in ["=1", "a..b=1", "a b=1", "\"a=1"] {
            assert!(matches!(path.parse::<Override>(), Err(OverrideError::NoPath(_))), "{path}");
        }
        let deep = format!("{}a=1", "a.".repeat(1000));
        assert!(deep.parse::<Override>().is_err());
    }
}
