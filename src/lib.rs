//! Model, protocol shell and records of an ultrasonic ranger on a stepper.
//!
//! The data flow, in the order of the modules:
//!
//! From a [`scene`] (walls and cylinders with materials) and the [`acoustics`] of air, transducer
//! and receiver, a [`model`] predicts the reading at each azimuth of a [`scan`]; the same records
//! hold measured readings, and [`compare`] compares the two. [`plot`] draws all of it. An
//! [`array`](mod@array) has several rangers at fixed bearings instead of one that turns.
//!
//! ```
//! use std::sync::Arc;
//!
//! use sonard::{
//!     acoustics::{Air, Sensor},
//!     model::{Options, Simulator},
//!     scan::ScanPlan,
//!     scene::{Scene, shipped},
//! };
//!
//! let text = shipped::text("simple-room").ok_or("not shipped")?;
//! let scene = Arc::new(Scene::from_json(text)?);
//! let pose = scene.pose("fig9")?;
//! let sensor = Sensor::preset("senscomp-6500")?;
//! let simulator = Simulator::new(scene, sensor, Air::default(), Options::default())?;
//! let readings = simulator.predict(&pose, &ScanPlan::default())?;
//! // At azimuth 270 the wall is 85 mm away; the near, the far and the near wall reflect the sound.
//! let range_m = readings[300].range_m.ok_or("silent")?;
//! let path = readings[300].arrival.as_ref().ok_or("silent")?;
//! assert!((path.length_m - 1.654).abs() < 1e-6);
//! // Weakened by reflectances and air, it crosses the threshold a little late.
//! assert!((range_m - 0.828).abs() < 0.001);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Those modules are pure: no clock, no file, no socket, and random numbers are passed in. They
//! build without default features. Behind the feature `daemon`, [`link`] opens serial lines, [`ranger`]
//! drives the protocol, [`mock`] plays the device from the model, [`store`] keeps logs, and
//! [`collect`] keeps a collection of scans that is taken over days.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub use sonard_export as export;
#[cfg(feature = "floorplan")]
pub use sonard_floorplan as floorplan;
#[cfg(feature = "store")]
pub use sonard_generate as generate;
pub use sonard_import as import;
pub use sonard_interpret::{compare, interpret};
#[cfg(feature = "inverse")]
pub use sonard_inverse as inverse;
#[cfg(feature = "store")]
pub use sonard_log::{self as store, dataset, grid_file};
pub use sonard_model::{acoustics, array, geometry, model, motion, scene, viewpoint};
#[cfg(feature = "plot")]
pub use sonard_plot as plot;
pub use sonard_records as scan;
#[cfg(feature = "inverse")]
pub use sonard_survey as survey;

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "daemon")]
pub use sonard_api::{self as api, client, config, fleet};
#[cfg(feature = "daemon")]
pub use sonard_collect as collect;
#[cfg(feature = "daemon")]
pub use sonard_daemon::{self as daemon, secret, server};
#[cfg(feature = "pi")]
pub use sonard_device::pi;
#[cfg(feature = "daemon")]
pub use sonard_device::{host_gpio, link, ranger, thermometer};
#[cfg(feature = "daemon")]
pub use sonard_mock as mock;
#[cfg(feature = "mqtt")]
pub use sonard_mqtt as mqtt;
#[cfg(feature = "ros")]
pub use sonard_ros as ros;
#[cfg(feature = "cli")]
pub use sonard_runtime::{backoff, interrupts, messages, platform, supervisor};
