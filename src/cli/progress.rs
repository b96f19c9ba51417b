//! A progress bar for long work, shown only on a terminal.

use super::output::width;
use indicatif::{ProgressBar, ProgressStyle};

/// Steps of the bar.
const STEPS: u64 = 100;

/// A bar that says what is being done.
pub struct Progress(ProgressBar);

impl Progress {
    /// Creates a bar at its start; it is hidden if standard error is not a terminal.
    pub fn new() -> Self {
        let bar = ProgressBar::new(STEPS);
        // The bar is narrow on a narrow terminal, to leave room for the message.
        let wide = width(true).clamp(40, 120) / 5;
        let template = format!("{{spinner}} {{bar:{wide}}} {{percent:>3}} %  {{elapsed:>4}}  {{wide_msg}}");
        bar.set_style(ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar()));
        // Some steps are long; the running clock shows that work continues.
        bar.enable_steady_tick(std::time::Duration::from_millis(250));
        Self(bar)
    }

    /// Sets the message and the share that is done.
    pub fn tell(&self, what: &str, share: f64) {
        self.say(what);
        self.0.set_position((share * STEPS as f64) as u64);
    }

    /// Sets the message.
    pub fn say(&self, what: &str) {
        self.0.set_message(what.to_owned());
    }

    /// Prints a permanent line to standard error, whether or not it is a terminal.
    pub fn line(&self, text: &str) {
        self.0.suspend(|| eprintln!("{text}"));
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}

impl Drop for Progress {
    /// Removes the bar however the work ends, so that the next output starts on a clean line.
    fn drop(&mut self) {
        self.finish();
    }
}

impl Default for Progress {
    fn default() -> Self {
        Self::new()
    }
}
