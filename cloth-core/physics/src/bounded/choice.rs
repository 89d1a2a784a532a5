//! Choices: a name, or a table with exactly one key.

use std::fmt;
use std::marker::PhantomData;

use serde::de::value::StrDeserializer;
use serde::de::{
    Deserialize, DeserializeSeed, Deserializer, EnumAccess, Error, IntoDeserializer, MapAccess, VariantAccess, Visitor,
};

use super::strict::Strict;

/// Formats names for a message.
fn listed(names: &[&str]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// Passes a name or a table with exactly one key to the visitor of an enum, with errors that list the alternatives.
pub(super) struct OneOf<V> {
    pub names: &'static [&'static str],
    pub visitor: V,
}

impl<'de, V: Visitor<'de>> Visitor<'de> for OneOf<V> {
    type Value = V::Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "one of {}", listed(self.names))
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<V::Value, E> {
        let name: StrDeserializer<'_, E> = name.into_deserializer();
        self.visitor.visit_enum(name)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<V::Value, A::Error> {
        self.visitor.visit_enum(OneKey { map, names: self.names, first: String::new() })
    }
}

/// A table with exactly one key, the name of an alternative.
struct OneKey<A> {
    map: A,
    names: &'static [&'static str],
    first: String,
}

impl<'de, A: MapAccess<'de>> EnumAccess<'de> for OneKey<A> {
    type Error = A::Error;
    type Variant = Self;

    fn variant_seed<S: DeserializeSeed<'de>>(mut self, seed: S) -> Result<(S::Value, Self), A::Error> {
        let named = self.map.next_key_seed(Named(seed))?;
        let (value, first) = named.ok_or_else(|| self.error("none"))?;
        self.first = first;
        Ok((value, self))
    }
}

impl<'de, A: MapAccess<'de>> OneKey<A> {
    fn error(&self, got: &str) -> A::Error {
        A::Error::custom(format!("expected exactly one of {}, got {got}", listed(self.names)))
    }

    fn value<S: DeserializeSeed<'de>>(mut self, seed: S) -> Result<S::Value, A::Error> {
        let value = self.map.next_value_seed(Strict(seed));
        // A second alternative explains more than an error within the first.
        match self.map.next_key::<String>() {
            Ok(Some(second)) => Err(self.error(&listed(&[&self.first, &second]))),
            _ => value,
        }
    }
}

impl<'de, A: MapAccess<'de>> VariantAccess<'de> for OneKey<A> {
    type Error = A::Error;

    fn unit_variant(self) -> Result<(), A::Error> {
        self.value(PhantomData::<()>)
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, A::Error> {
        self.value(seed)
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, A::Error> {
        self.value(Visited(visitor))
    }

    fn struct_variant<V: Visitor<'de>>(self, _: &'static [&'static str], visitor: V) -> Result<V::Value, A::Error> {
        self.value(Visited(visitor))
    }
}

/// Passes a value to a visitor.
struct Visited<V>(V);

impl<'de, V: Visitor<'de>> DeserializeSeed<'de> for Visited<V> {
    type Value = V::Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<V::Value, D::Error> {
        deserializer.deserialize_any(self.0)
    }
}

/// Reads a key with a seed and keeps its text.
struct Named<S>(S);

impl<'de, S: DeserializeSeed<'de>> DeserializeSeed<'de> for Named<S> {
    type Value = (S::Value, String);

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        let name = String::deserialize(deserializer)?;
        let text: StrDeserializer<'_, D::Error> = name.as_str().into_deserializer();
        self.0.deserialize(text).map(|value| (value, name.clone()))
    }
}
