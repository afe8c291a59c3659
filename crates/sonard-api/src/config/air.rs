//! Configuration keys of the air, mostly shared by daemon and collections.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Defines a section with the common air keys and further ones with their defaults.
macro_rules! air_section {
    (
        $(#[$about:meta])*
        $name:ident { $($(#[$further:meta])* $key:ident: $kind:ty = $default:expr,)* }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            /// Temperature, degrees Celsius, until a thermometer or an API client sets another.
            #[schemars(range(min = -20, max = 50))]
            pub temperature_c: f64,
            /// Relative humidity, percent.
            #[schemars(range(min = 0, max = 100))]
            pub humidity_percent: f64,
            /// Static pressure, kilopascals.
            #[schemars(range(min = 60, max = 110))]
            pub pressure_kpa: f64,
            /// File of a 1-wire (w1_slave, temperature) or hwmon (temp1_input) thermometer, in
            /// thousandths of a degree Celsius. Values outside the physical range are rejected; the
            /// last valid one stays in use.
            #[schemars(example = "/sys/bus/w1/devices/28-0316a1d2f8ff/temperature")]
            pub file: Option<String>,
            $($(#[$further])* pub $key: $kind,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self {
                    temperature_c: 20.0,
                    humidity_percent: 50.0,
                    pressure_kpa: 101.325,
                    file: None,
                    $($key: $default,)*
                }
            }
        }
    };
}

air_section! {
    /// Air data, which determine the speed of sound.
    AirKeys {
        /// Interval between readings of the file, seconds.
        #[schemars(range(min = 1, max = 3600))]
        every_s: f64 = 30.0,
        /// Age from which a temperature is reported as stale, seconds.
        #[schemars(range(min = 1, max = 604_800))]
        max_age_s: f64 = 600.0,
    }
}

air_section! {
    /// Air data of a collection. A thermometer's file is read before and after each scan.
    CollectionAirKeys {}
}
