//! The command `kisspoint`; see [`kisspoint::cli`].

fn main() -> std::process::ExitCode {
    kisspoint::cli::run()
}
