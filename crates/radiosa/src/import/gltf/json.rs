//! A cursor over the document that knows the way it came, so that every complaint names its place.

use std::path::Path;

use serde_json::{Map, Value};

use super::super::{ImportError, Location};

/// One value of the document and its JSON pointer.
#[derive(Clone, Debug)]
pub(super) struct Item<'a> {
    value: &'a Value,
    file: &'a Path,
    pointer: String,
}

impl<'a> Item<'a> {
    /// The whole document.
    pub(super) fn root(value: &'a Value, file: &'a Path) -> Self {
        Self { value, file, pointer: String::new() }
    }

    /// Where it is, such as `/meshes/3/primitives/0`.
    pub(super) fn pointer(&self) -> &str {
        if self.pointer.is_empty() { "/" } else { &self.pointer }
    }

    /// The file it is in.
    pub(super) fn file(&self) -> &'a Path {
        self.file
    }

    /// Where it is, for errors.
    pub(super) fn location(&self) -> Location {
        Location::inside(self.file, self.pointer())
    }

    /// An error about this value.
    pub(super) fn error(&self, message: impl Into<String>) -> ImportError {
        ImportError::invalid(self.location(), message)
    }

    /// An error about this value, with advice.
    pub(super) fn error_with_help(&self, message: impl Into<String>, help: impl Into<String>) -> ImportError {
        ImportError::invalid_with_help(self.location(), message, help)
    }

    fn child(&self, key: &str, value: &'a Value) -> Self {
        // RFC 6901: ~ and / inside a key are escaped.
        let key = key.replace('~', "~0").replace('/', "~1");
        Self { value, file: self.file, pointer: format!("{}/{key}", self.pointer) }
    }

    fn wrong_type(&self, wanted: &str) -> ImportError {
        let mut shown = self.value.to_string();
        if shown.chars().count() > 40 {
            shown = shown.chars().take(37).chain("...".chars()).collect();
        }
        self.error(format!("{wanted} is needed here, not {shown}"))
    }

    fn map(&self) -> Result<&'a Map<String, Value>, ImportError> {
        self.value.as_object().ok_or_else(|| self.wrong_type("an object"))
    }

    /// A member of an object, `None` when absent.
    pub(super) fn get(&self, key: &str) -> Result<Option<Self>, ImportError> {
        Ok(self.map()?.get(key).map(|v| self.child(key, v)))
    }

    /// A member that must be there.
    pub(super) fn require(&self, key: &str) -> Result<Self, ImportError> {
        self.get(key)?.ok_or_else(|| self.error(format!("`{key}` is missing")))
    }

    /// A member that is an object, when present.
    pub(super) fn object(&self, key: &str) -> Result<Option<Self>, ImportError> {
        let item = self.get(key)?;
        if let Some(item) = &item {
            item.map()?;
        }
        Ok(item)
    }

    /// The members of an object, in the order of their names.
    pub(super) fn members(&self) -> Result<impl Iterator<Item = (&'a str, Self)> + use<'a>, ImportError> {
        let own = self.clone();
        Ok(self.map()?.iter().map(move |(key, value)| (key.as_str(), own.child(key, value))))
    }

    /// One extension of an object, when present.
    pub(super) fn extension(&self, name: &str) -> Result<Option<Self>, ImportError> {
        match self.object("extensions")? {
            Some(extensions) => extensions.object(name),
            None => Ok(None),
        }
    }

    /// A member that is an array; an empty one when it is absent.
    pub(super) fn array(&self, key: &str) -> Result<Array<'a>, ImportError> {
        match self.get(key)? {
            None => Ok(Array { values: &[], file: self.file, pointer: format!("{}/{key}", self.pointer) }),
            Some(item) => item.as_array(),
        }
    }

    /// The value as an array.
    pub(super) fn as_array(&self) -> Result<Array<'a>, ImportError> {
        let values = self.value.as_array().ok_or_else(|| self.wrong_type("an array"))?;
        Ok(Array { values, file: self.file, pointer: self.pointer.clone() })
    }

    /// The value as a finite number.
    pub(super) fn as_number(&self) -> Result<f64, ImportError> {
        self.value.as_f64().filter(|v| v.is_finite()).ok_or_else(|| self.wrong_type("a number"))
    }

    /// The value as a number from 0 to 2⁵³; `3.0` counts as 3, as JSON has only one kind of number.
    pub(super) fn as_count(&self) -> Result<u64, ImportError> {
        const LARGEST: f64 = 9_007_199_254_740_992.0;
        let from_float = || self.value.as_f64().filter(|v| v.fract() == 0.0 && (0.0..=LARGEST).contains(v)).map(|v| v as u64);
        self.value.as_u64().or_else(from_float).ok_or_else(|| self.wrong_type("a whole number from 0"))
    }

    /// The value as text.
    pub(super) fn as_text(&self) -> Result<&'a str, ImportError> {
        self.value.as_str().ok_or_else(|| self.wrong_type("a string"))
    }

    /// A number, when present.
    pub(super) fn number(&self, key: &str) -> Result<Option<f64>, ImportError> {
        self.get(key)?.map(|v| v.as_number()).transpose()
    }

    /// A whole number, when present.
    pub(super) fn count(&self, key: &str) -> Result<Option<u64>, ImportError> {
        self.get(key)?.map(|v| v.as_count()).transpose()
    }

    /// Text, when present.
    pub(super) fn text(&self, key: &str) -> Result<Option<&'a str>, ImportError> {
        self.get(key)?.map(|v| v.as_text()).transpose()
    }

    /// True or false, when present.
    pub(super) fn flag(&self, key: &str) -> Result<Option<bool>, ImportError> {
        self.get(key)?.map(|v| v.value.as_bool().ok_or_else(|| v.wrong_type("true or false"))).transpose()
    }

    /// `N` numbers, when present.
    pub(super) fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, ImportError> {
        let Some(item) = self.get(key)? else { return Ok(None) };
        let array = item.as_array()?;
        if array.len() != N {
            return Err(item.error(format!("{N} numbers are needed here, not {}", array.len())));
        }
        let mut out = [0.0; N];
        for (i, out) in out.iter_mut().enumerate() {
            *out = array.number(i)?;
        }
        Ok(Some(out))
    }

    /// The `name` member, empty when absent or no text: a name is never worth refusing a file for.
    pub(super) fn name(&self) -> String {
        self.value.get("name").and_then(Value::as_str).unwrap_or_default().to_owned()
    }

    /// Whether a member is present.
    pub(super) fn has(&self, key: &str) -> bool {
        self.value.get(key).is_some()
    }
}

/// An array of the document. Its elements get their pointers only when they are asked for: arrays may be long.
#[derive(Clone, Debug)]
pub(super) struct Array<'a> {
    values: &'a [Value],
    file: &'a Path,
    pointer: String,
}

impl<'a> Array<'a> {
    /// How many elements.
    pub(super) fn len(&self) -> usize {
        self.values.len()
    }

    /// One element.
    pub(super) fn get(&self, index: usize) -> Option<Item<'a>> {
        let value = self.values.get(index)?;
        Some(Item { value, file: self.file, pointer: format!("{}/{index}", self.pointer) })
    }

    /// All elements.
    pub(super) fn iter(&self) -> impl Iterator<Item = Item<'a>> + '_ {
        (0..self.len()).filter_map(|i| self.get(i))
    }

    /// One element as a finite number; 0 beyond the end.
    fn number(&self, index: usize) -> Result<f64, ImportError> {
        // The pointer is made only for the error: matrices and weights are many.
        match self.values.get(index).map(Value::as_f64) {
            Some(Some(v)) if v.is_finite() => Ok(v),
            _ => self.get(index).map_or(Ok(0.0), |item| item.as_number()),
        }
    }

    /// All elements as finite numbers.
    pub(super) fn numbers(&self) -> Result<Vec<f64>, ImportError> {
        (0..self.len()).map(|i| self.number(i)).collect()
    }
}

/// One of the document's top-level arrays, to resolve references into.
#[derive(Clone, Debug)]
pub(super) struct Table<'a> {
    kind: &'static str,
    array: Array<'a>,
}

impl<'a> Table<'a> {
    /// The array `key` of `parent`; `kind` is what messages call one element.
    pub(super) fn new(parent: &Item<'a>, key: &str, kind: &'static str) -> Result<Self, ImportError> {
        Ok(Self { kind, array: parent.array(key)? })
    }

    /// One of them.
    pub(super) fn get(&self, index: usize) -> Option<Item<'a>> {
        self.array.get(index)
    }

    /// All of them.
    pub(super) fn iter(&self) -> impl Iterator<Item = Item<'a>> + '_ {
        self.array.iter()
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.array.len()
    }

    /// The index a reference holds, checked against the length of the table.
    pub(super) fn index(&self, reference: &Item<'a>) -> Result<usize, ImportError> {
        let index = reference.as_count()?;
        let found = usize::try_from(index).ok().filter(|&i| i < self.len());
        found.ok_or_else(|| {
            let (kind, has) = (self.kind, if self.len() == 0 { "none".to_owned() } else { format!("only {}", self.len()) });
            reference.error(format!("it refers to {kind} {index}, but the file has {has}"))
        })
    }

    /// Follows a reference.
    pub(super) fn resolve(&self, reference: &Item<'a>) -> Result<(usize, Item<'a>), ImportError> {
        let index = self.index(reference)?;
        let item = self.get(index).ok_or_else(|| reference.error("the reference leads nowhere"))?;
        Ok((index, item))
    }

    /// Follows the reference in member `key` of `from`, when present.
    pub(super) fn resolve_in(&self, from: &Item<'a>, key: &str) -> Result<Option<(usize, Item<'a>)>, ImportError> {
        from.get(key)?.map(|reference| self.resolve(&reference)).transpose()
    }
}
