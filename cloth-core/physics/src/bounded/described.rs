//! The schemas of values.

use schemars::{Schema, json_schema};

/// Implements the schema of a type, and the serialisation of its values, which the schema's defaults need.
macro_rules! described {
    ([$($generics:tt)*] $name:ty, $value:ty, $schema:expr) => {
        impl<$($generics)*> schemars::JsonSchema for $name {
            fn inline_schema() -> bool {
                true
            }

            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                $schema
            }
        }

        impl<$($generics)*> $name {
            /// Writes the value. Only fields with a default need this.
            pub fn serialize<S: serde::Serializer>(value: &$value, serializer: S) -> Result<S::Ok, S::Error> {
                serde::Serialize::serialize(value, serializer)
            }
        }
    };
}

pub(super) use described;

/// Returns the schema of an array of exactly `count` items.
pub(super) fn array(items: &Schema, count: usize) -> Schema {
    json_schema!({ "type": "array", "items": items, "minItems": count, "maxItems": count })
}
