//! The macros behind the message tables, and the hash over them.
//!
//! Each message is written once. From that one text come the Rust type, its encoding,
//! a description that the protocol document is compared with, and the schema hash.

/// One variant of a message or code enum: its code, its name, and its fields as
/// `name: type` separated by `, ` (a bare type stands for the fields of that record).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Variant {
    /// Number on the wire.
    pub code: u8,
    /// Name in the code and in the document.
    pub name: &'static str,
    /// Fields in wire order.
    pub fields: &'static [Field],
}

/// One field of a message or record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Name, or empty for a variant that carries a whole record.
    pub name: &'static str,
    /// Rust type, which fixes the encoding.
    pub kind: &'static str,
}

/// Defines an enum whose variants are numbered on the wire in the order written.
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
            /// Codes, names and fields in wire order.
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

            // Where the variant is known, nothing is left of the others.
            #[inline(always)]
            fn put(&self, out: &mut $crate::messages::Writer<'_>) {
                // Apart from the fields, so that it is one byte that is already there.
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

/// Defines a record: a struct whose fields are encoded in the order written.
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
            /// Names and types in wire order.
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

/// Names the record of a variant in a pattern and in an expression alike.
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

/// The first variant without fields.
macro_rules! first_unit {
    ($variant:ident $(, $($rest:tt)*)?) => { Self::$variant };
    ($variant:ident ($($fields:tt)*), $($rest:tt)*) => { $crate::messages::table::first_unit!($($rest)*) };
    ($variant:ident {$($fields:tt)*}, $($rest:tt)*) => { $crate::messages::table::first_unit!($($rest)*) };
}

/// Writes a record field by field, each read where it is when its turn comes: a record that is
/// first made and then written passes through a microcontroller's stack byte by byte. The
/// fields stand in the record's own order.
macro_rules! put_record {
    ($out:expr, $record:ident { $($field:ident: $value:expr),+ $(,)? }) => {{
        const _: () = $crate::messages::table::assert_order(
            $record::FIELDS, &[$(stringify!($field)),+]);
        $($value.put($out);)+
    }};
}

pub(crate) use {any, bind, first_unit, put_record, wire_enum, wire_struct};

/// Codes must count up from 0, because postcard numbers variants so.
pub(crate) const fn assert_codes(variants: &[Variant]) {
    let mut index = 0;
    while index < variants.len() {
        assert!(variants[index].code as usize == index, "codes must count up from 0");
        index += 1;
    }
}

/// Names must be those of the fields, in their order.
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

/// The code of variant `name`.
pub(crate) const fn code_of(variants: &[Variant], name: &str) -> u8 {
    let mut index = 0;
    while index < variants.len() {
        let (this, wanted) = (variants[index].name.as_bytes(), name.as_bytes());
        let mut at = 0;
        while at < this.len() && at < wanted.len() && this[at] == wanted[at] {
            at += 1;
        }
        if at == this.len() && at == wanted.len() {
            return variants[index].code;
        }
        index += 1;
    }
    panic!("no such variant")
}

/// FNV-1a, 32 bits, over names and types of the tables.
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

/// Spaces are left out: how a compiler prints a type must not change the hash.
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
