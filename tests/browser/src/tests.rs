//! Tests of the live page and the playground in Chromium.

mod live_page;
mod playground;
