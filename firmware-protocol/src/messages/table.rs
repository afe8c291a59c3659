//! Macros behind the message tables, and the schema hash.
//!
//! Each message is written once. The macros derive from it the Rust type, the encoding, a
//! description to compare with the protocol document, and the schema hash.

/// Variant of a message or code enum: code, name and fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Variant {
    /// Code on the wire.
    pub code: u8,
    /// Name in the code and in the document.
    pub name: &'static str,
    /// Fields in wire order; a variant that carries a record has one field without a name.
    pub fields: &'static [Field],
}

/// Field of a message or record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Name; empty for a variant that carries a whole record.
    pub name: &'static str,
    /// Rust type, which determines the encoding.
    pub kind: &'static str,
}

/// Defines an enum whose variants are numbered on the wire in source order.
macro_rules! wire_enum {
    (
        $(#[$meta:meta])*
        pub enum $name:ident {
            $(
                $(#[$variant_meta:meta])*
                $code:literal $variant:ident
                $(($record:ty))?
                $({ $($(#[$field_meta:meta])* $field:ident: $kind:ty),+ $(,)? })?
            ),+ $(,)?
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        pub enum $name {
            $(
                $(#[$variant_meta])*
                $variant $(($record))? $({ $($(#[$field_meta])* $field: $kind),+ })?
            ),+
        }

        impl $name {
            /// Codes, names and fields of the variants, in wire order.
            pub const VARIANTS: &'static [$crate::messages::Variant] = &[
                $($crate::messages::Variant {
                    code: $code,
                    name: stringify!($variant),
                    fields: &[
                        $($crate::messages::Field { name: "", kind: stringify!($record) })?
                        $($($crate::messages::Field {
                            name: stringify!($field),
                            kind: stringify!($kind),
                        }),+)?
                    ],
                }),+
            ];
        }

        impl $crate::messages::Wire for $name {
            const BLANK: Self = $crate::messages::table::first_unit!(
                $($variant $(($record))? $({ $($field)+ })?),+);

            // With the variant known, the compiler drops the others.
            #[inline(always)]
            fn put(&self, out: &mut $crate::messages::Writer<'_>) {
                // The code is written separately from the fields: it is the discriminant byte in
                // memory.
                out.byte(match self {
                    $(Self::$variant $(($crate::messages::table::any!($record)))? $({ $($field: _),+ })? => $code),+
                });
                match self {
                    $(
                        Self::$variant
                            $(($crate::messages::table::bind!(record $record)))?
                            $({ $($field),+ })?
                        => {
                            $(<$record as $crate::messages::Wire>::put(
                                $crate::messages::table::bind!(record $record), out);)?
                            $($($crate::messages::Wire::put($field, out);)+)?
                        }
                    ),+
                }
            }

            fn read(&mut self, input: &mut $crate::messages::Reader<'_>) {
                match input.code() {
                    $(
                        $code => {
                            *self = Self::$variant
                                $((<$record as $crate::messages::Wire>::BLANK))?
                                $({ $($field: $crate::messages::Wire::BLANK),+ })?;
                            if let Self::$variant
                                $(($crate::messages::table::bind!(record $record)))?
                                $({ $($field),+ })? = self
                            {
                                $(<$record as $crate::messages::Wire>::read(
                                    $crate::messages::table::bind!(record $record), input);)?
                                $($($crate::messages::Wire::read($field, input);)+)?
                            }
                        }
                    )+
                    _ => input.fail(),
                }
            }
        }

        const _: () = $crate::messages::table::assert_codes($name::VARIANTS);
    };
}

/// Defines a record: a struct whose fields are encoded in source order.
macro_rules! wire_struct {
    (
        $(#[$meta:meta])*
        pub struct $name:ident {
            $($(#[$field_meta:meta])* $field:ident: $kind:ty),+ $(,)?
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        pub struct $name {
            $($(#[$field_meta])* pub $field: $kind),+
        }

        impl $name {
            /// Names and types of the fields, in wire order.
            pub const FIELDS: &'static [$crate::messages::Field] = &[
                $($crate::messages::Field {
                    name: stringify!($field),
                    kind: stringify!($kind),
                }),+
            ];
        }

        impl $crate::messages::Wire for $name {
            const BLANK: Self = Self { $($field: <$kind as $crate::messages::Wire>::BLANK),+ };

            fn put(&self, out: &mut $crate::messages::Writer<'_>) {
                $($crate::messages::Wire::put(&self.$field, out);)+
            }

            fn read(&mut self, input: &mut $crate::messages::Reader<'_>) {
                $($crate::messages::Wire::read(&mut self.$field, input);)+
            }
        }
    };
}

/// Names the record of a variant, in patterns and in expressions.
macro_rules! bind {
    ($name:ident $record:ty) => {
        $name
    };
}

/// Ignores the record of a variant in a pattern.
macro_rules! any {
    ($record:ty) => {
        _
    };
}

/// Selects the first variant without fields.
macro_rules! first_unit {
    ($variant:ident $(, $($rest:tt)*)?) => { Self::$variant };
    ($variant:ident ($($fields:tt)*), $($rest:tt)*) => { $crate::messages::table::first_unit!($($rest)*) };
    ($variant:ident {$($fields:tt)*}, $($rest:tt)*) => { $crate::messages::table::first_unit!($($rest)*) };
}

/// Writes a record field by field, each evaluated when its turn comes, in declaration order. A
/// record that is built first and then written would pass through a microcontroller's stack byte by
/// byte.
macro_rules! put_record {
    ($out:expr, $record:ident { $($field:ident: $value:expr),+ $(,)? }) => {{
        const _: () = $crate::messages::table::assert_order(
            $record::FIELDS, &[$(stringify!($field)),+]);
        $($value.put($out);)+
    }};
}

pub(crate) use {any, bind, first_unit, put_record, wire_enum, wire_struct};

/// Asserts that codes count up from 0, as postcard numbers variants.
pub(crate) const fn assert_codes(variants: &[Variant]) {
    let mut index = 0;
    while index < variants.len() {
        assert!(variants[index].code as usize == index, "codes must count up from 0");
        index += 1;
    }
}

/// Asserts that `names` are the names of `fields`, in the same order.
pub(crate) const fn assert_order(fields: &[Field], names: &[&str]) {
    assert!(fields.len() == names.len(), "every field once");
    let mut index = 0;
    while index < fields.len() {
        let (name, written) = (fields[index].name.as_bytes(), names[index].as_bytes());
        assert!(name.len() == written.len(), "fields in the record's order");
        let mut at = 0;
        while at < name.len() {
            assert!(name[at] == written[at], "fields in the record's order");
            at += 1;
        }
        index += 1;
    }
}

/// Returns the code of variant `name`.
pub(crate) const fn code_of(variants: &[Variant], name: &str) -> u8 {
    let mut index = 0;
    while index < variants.len() {
        let (candidate, target) = (variants[index].name.as_bytes(), name.as_bytes());
        let mut at = 0;
        while at < candidate.len() && at < target.len() && candidate[at] == target[at] {
            at += 1;
        }
        if at == candidate.len() && at == target.len() {
            return variants[index].code;
        }
        index += 1;
    }
    panic!("no such variant")
}

/// Offset basis of FNV-1a with 32 bits.
pub(crate) const HASH_START: u32 = 0x811c_9dc5;

pub(crate) const fn hash_enum(mut hash: u32, name: &str, variants: &[Variant]) -> u32 {
    hash = hash_text(hash, name);
    let mut index = 0;
    while index < variants.len() {
        hash = hash_byte(hash, variants[index].code);
        hash = hash_struct(hash, variants[index].name, variants[index].fields);
        index += 1;
    }
    hash
}

pub(crate) const fn hash_struct(mut hash: u32, name: &str, fields: &[Field]) -> u32 {
    hash = hash_text(hash, name);
    let mut index = 0;
    while index < fields.len() {
        hash = hash_text(hash, fields[index].name);
        hash = hash_text(hash, fields[index].kind);
        index += 1;
    }
    hash
}

/// Hashes `text` without spaces, because the compiler's formatting of types must not matter.
const fn hash_text(mut hash: u32, text: &str) -> u32 {
    let bytes = text.as_bytes();
    let mut index = 0;
    while index < bytes.len() {
        if bytes[index] != b' ' {
            hash = hash_byte(hash, bytes[index]);
        }
        index += 1;
    }
    hash_byte(hash, 0)
}

const fn hash_byte(hash: u32, byte: u8) -> u32 {
    (hash ^ byte as u32).wrapping_mul(0x0100_0193)
}
