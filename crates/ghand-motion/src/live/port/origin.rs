//! Which pages may send live poses.
//!
//! A browser lets any page connect to a port of this computer, and names the page's origin. Pages of this computer are
//! allowed: those from a local server, and files, which have the origin `null`. Programs send no origin; who runs
//! programs here needs no permission. All other pages are refused, unless the user names their origin. A page in a
//! sandbox also has the origin `null`. What it could do is move the hand: nothing is ever sent to a page.

/// Names of this computer, as in addresses.
const LOCAL: [&str; 3] = ["localhost", "127.0.0.1", "[::1]"];

/// Whether a page of this origin may connect; `None` if the client gives none.
pub fn is_allowed(origin: Option<&str>, allowed: &[String]) -> bool {
    let Some(origin) = origin else { return true };
    let is_same = |other: &String| other.trim_end_matches('/').eq_ignore_ascii_case(origin);
    origin == "null" || is_local(origin) || allowed.iter().any(is_same)
}

fn is_local(origin: &str) -> bool {
    let Some(host) = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://")) else { return false };
    let is_port =
        |text: &str| text.is_empty() || text.strip_prefix(':').is_some_and(|port| port.parse::<u16>().is_ok());
    LOCAL.iter().any(|local| host.strip_prefix(local).is_some_and(is_port))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_of_this_computer_and_named_ones_are_allowed_and_no_others() {
        let named = ["https://hands.example/".to_owned()];
        for origin in [
            "null",
            "http://localhost",
            "http://localhost:8000",
            "https://127.0.0.1:8443",
            "http://[::1]:80",
            "https://hands.example",
        ] {
            assert!(is_allowed(Some(origin), &named), "{origin}");
        }
        assert!(is_allowed(None, &[]));
        for origin in [
            "",
            "https://example.org",
            "http://localhost.example.org",
            "http://localhost:80.example.org",
            "http://127.0.0.1.example.org",
            "http://example.org:4263",
            "https://hands.example.org",
            "ftp://localhost",
            "localhost",
            "nullx",
        ] {
            assert!(!is_allowed(Some(origin), &named), "{origin}");
        }
    }
}
