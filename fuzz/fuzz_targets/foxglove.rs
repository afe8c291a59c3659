//! Arbitrary messages of a viewer, one per line: none panics or subscribes to a channel that does
//! not exist, and responses are few and short.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sonard::export::foxglove::{ViewerAction, ViewerSession};

fuzz_target!(|bytes: &[u8]| {
    let is_there = |channel: u32| (1..=4).contains(&channel);
    let mut session = ViewerSession::default();
    for text in bytes.split(|byte| *byte == b'\n') {
        let steps = match std::str::from_utf8(text) {
            Ok(text) => session.handle_text(text, is_there),
            Err(_) => session.handle_binary(),
        };
        assert!(steps.len() <= 10, "{steps:?}");
        for step in &steps {
            if let ViewerAction::SendText(text) = step {
                assert!(text.len() < 2000, "{text}");
            }
        }
        let channels: Vec<u32> = session.channels().collect();
        assert!(channels.iter().all(|channel| is_there(*channel)));
        for channel in channels {
            assert_eq!(session.frame(channel, 1, b"body").map(|frame| frame.len()), Some(17));
        }
    }
});
