//! Progress of a survey, reported to the page, and its end.

use sonard_survey::{SurveyObserver, SurveyProgress};

/// Observer that reports progress to the page, which limits the time of a survey.
pub(crate) struct PageObserver;

impl SurveyObserver for PageObserver {
    fn progress(&self, progress: SurveyProgress) {
        if let Ok(text) = serde_json::to_string(&progress) {
            page::report(&text);
        }
    }

    fn is_cancelled(&self) -> bool {
        page::is_time_over()
    }
}

/// Functions of the page's worker.
#[cfg(target_arch = "wasm32")]
#[allow(unsafe_code)]
mod page {
    #[link(wasm_import_module = "page")]
    unsafe extern "C" {
        fn report_progress(text: *const u8, bytes: usize);
        safe fn is_survey_over() -> u32;
    }

    pub(super) fn report(text: &str) {
        // SAFETY: the page reads the text during the call and does not write.
        unsafe { report_progress(text.as_ptr(), text.len()) }
    }

    pub(super) fn is_time_over() -> bool {
        is_survey_over() != 0
    }
}

/// Programs other than the page's module have neither page nor limit.
#[cfg(not(target_arch = "wasm32"))]
mod page {
    pub(super) fn report(_: &str) {}

    pub(super) fn is_time_over() -> bool {
        false
    }
}
