//! Enums in settings by name alone: `rule = "tau_only"` for `rule = { tau_only = {} }`.

use serde::de::value::{MapAccessDeserializer, StringDeserializer};
use serde::de::{Error, IntoDeserializer as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::marker::PhantomData;
use toml::{Table, Value};

/// Reads a variant with fields from its name, too: its fields then have their defaults.
///
/// # Errors
/// Those of the enum, if the name is not a variant or a field has no default.
pub(crate) fn string_or_table<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<T, D::Error> {
    deserializer.deserialize_any(StringOrTable(PhantomData))
}

struct StringOrTable<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for StringOrTable<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a variant, or a table with its name as the one key")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<T, E> {
        let by_name: StringDeserializer<E> = name.to_owned().into_deserializer();
        T::deserialize(by_name).or_else(|error: E| {
            if error.to_string().contains("unknown variant") {
                return Err(error);
            }
            // A variant with fields.
            let with_defaults = Table::from_iter([(name.to_owned(), Value::Table(Table::new()))]);
            T::deserialize(Value::Table(with_defaults)).map_err(|error| E::custom(error.message()))
        })
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map))
    }
}
