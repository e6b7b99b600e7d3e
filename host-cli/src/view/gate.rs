//! Access control: checks of a request's address, its origin and its token.
//!
//! A page of another site must not reach the view. Browsers state in `Host` the name that they resolved: all
//! names but this machine's are refused, against DNS rebinding. Browsers state in `Origin` the site whose
//! script opens a connection: other sites are refused. Only people who have seen the printed address know the
//! token.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

use super::http::{Head, Refusal};
use super::page_files::{PageFile, page_file};

/// Path of the page.
const PAGE: &str = "/";
/// Path of the page by the name of its file.
const PAGE_FILE: &str = "/index.html";
/// Path of the WebSocket.
const SOCKET: &str = "/socket";
/// Path of the page that lends cards.
const LENDER: &str = "/lend.html";
/// Path of the WebSocket of a lent card.
const CARD: &str = "/card";
/// Path of the module that a lent card runs.
const MODULE: &str = "/photoncard.wasm";

/// Resource that an accepted request receives.
#[derive(Debug, PartialEq)]
pub(super) enum Resource {
    /// File of the page.
    File(&'static PageFile),
    /// WebSocket of a page, with the request's `Sec-WebSocket-Key`.
    Socket(String),
    /// WebSocket of a lent card, with that key.
    Card(String),
    /// WebAssembly module with the card.
    Module,
}

/// Access control of a server.
pub(super) struct Gate {
    address: SocketAddr,
    token: String,
    /// True if browsers may lend cards.
    has_lenders: bool,
}

impl Gate {
    /// Creates the access control of a server that listens at `address`, whose port is not 0.
    pub(super) fn new(address: SocketAddr, token: String, has_lenders: bool) -> Self {
        Self { address, token, has_lenders }
    }

    /// URL of the page on this machine, with the token.
    pub(super) fn url(&self) -> String {
        self.url_of(PAGE)
    }

    /// URL of the page that lends cards, with the token; `None` if browsers may lend none.
    pub(super) fn lenders_url(&self) -> Option<String> {
        self.has_lenders.then(|| self.url_of(LENDER))
    }

    fn url_of(&self, path: &str) -> String {
        let Self { address, token, .. } = self;
        let ip = match address.ip() {
            IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
            IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
            ip => ip,
        };
        let here = SocketAddr::new(ip, address.port());
        format!("http://{here}{path}?token={token}")
    }

    /// Checks a request, and returns the resource that it asks for.
    ///
    /// # Errors
    /// The refusal of a request for another host, from another site, without the token, or for a path that
    /// does not exist.
    pub(super) fn check(&self, head: &Head) -> Result<Resource, Refusal> {
        if head.method != "GET" {
            return Err(Refusal::new(405, "Method Not Allowed", "only GET is answered"));
        }
        let host = head.one("host").filter(|host| self.is_own(host));
        let host = host.ok_or(Refusal::forbidden("the request is for another host"))?;
        let own_origin = format!("http://{host}");
        let origins = head.all("origin");
        if origins.iter().any(|origin| *origin != own_origin) {
            return Err(Refusal::forbidden("the request comes from another site"));
        }
        let (path, query) = head.target.split_once('?').unwrap_or((&head.target, ""));
        match path {
            PAGE | PAGE_FILE => {
                self.check_token(query)?;
                page_file("index.html").map(Resource::File)
            }
            SOCKET | CARD => {
                self.check_token(query)?;
                if origins.is_empty() {
                    return Err(Refusal::forbidden("the request states no origin"));
                }
                let key = head.socket_key();
                match path {
                    SOCKET => key.map(Resource::Socket),
                    _ => key.filter(|_| self.has_lenders).map(Resource::Card),
                }
            }
            LENDER => {
                self.check_token(query)?;
                page_file("lend.html").filter(|_| self.has_lenders).map(Resource::File)
            }
            MODULE => self.has_lenders.then_some(Resource::Module),
            // Files of the page need no token: they hold nothing of the scene.
            _ => page_file(&path[1.min(path.len())..]).map(Resource::File),
        }
        .ok_or(Refusal::new(404, "Not Found", "there is nothing at this address"))
    }

    /// Returns whether a `Host` header names this server: by the address at which it listens, or as
    /// `localhost` if it listens at a loopback address or at all addresses. If it listens at all addresses,
    /// any IP address is valid.
    fn is_own(&self, host: &str) -> bool {
        let Self { address, .. } = self;
        let name = match host.strip_suffix(&format!(":{}", address.port())) {
            Some(name) => name,
            None if address.port() == 80 => host,
            None => return false,
        };
        let bare = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        match bare.parse::<IpAddr>() {
            Ok(named) => named == address.ip() || address.ip().is_unspecified(),
            Err(_) => {
                name.eq_ignore_ascii_case("localhost")
                    && (address.ip().is_loopback() || address.ip().is_unspecified())
            }
        }
    }

    fn check_token(&self, query: &str) -> Result<(), Refusal> {
        let given = query.split('&').find_map(|pair| pair.strip_prefix("token=")).unwrap_or_default();
        let (given, token) = (given.as_bytes(), self.token.as_bytes());
        // All bytes are compared, so that the time of the comparison is independent of the token.
        let differing = given.iter().zip(token).fold(0, |differing, (a, b)| differing | (a ^ b));
        if given.len() == token.len() && differing == 0 {
            return Ok(());
        }
        Err(Refusal::forbidden("the token is not that of this view: open the address that it has printed"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOKEN: &str = "0123456789abcdef0123456789abcdef";

    fn gate(address: &str) -> Gate {
        Gate::new(address.parse().unwrap(), TOKEN.into(), false)
    }

    /// HTTP status of a request; 101 for a WebSocket.
    fn status(gate: &Gate, target: &str, headers: &str) -> u16 {
        let text = format!("GET {target} HTTP/1.1\r\n{headers}\r\n");
        match Head::parse(text.as_bytes()).map(|head| gate.check(&head.unwrap())) {
            Ok(Ok(Resource::File(_) | Resource::Module)) => 200,
            Ok(Ok(Resource::Socket(_) | Resource::Card(_))) => 101,
            Ok(Err(refusal)) | Err(refusal) => refusal.status,
        }
    }

    #[test]
    fn the_page_requires_its_host_and_the_token() {
        let gate = gate("127.0.0.1:8080");
        assert_eq!(gate.url(), format!("http://127.0.0.1:8080/?token={TOKEN}"));
        assert_eq!(self::gate("0.0.0.0:8080").url(), gate.url());
        assert_eq!(self::gate("[::]:8080").url(), format!("http://[::1]:8080/?token={TOKEN}"));
        let page = format!("/?token={TOKEN}");
        for (target, headers, expected) in [
            (&*page, "Host: 127.0.0.1:8080\r\n", 200),
            (&*page, "host: LOCALHOST:8080\r\n", 200),
            (&*page, "Host: 127.0.0.1:8080\r\nOrigin: http://127.0.0.1:8080\r\n", 200),
            ("/main.js", "Host: 127.0.0.1:8080\r\n", 200),
            ("/view.css?x", "Host: localhost:8080\r\n", 200),
            (&*page, "", 403),
            (&*page, "Host: 127.0.0.1\r\n", 403),
            (&*page, "Host: 127.0.0.1:80\r\n", 403),
            (&*page, "Host: 127.0.0.2:8080\r\n", 403),
            (&*page, "Host: evil.example:8080\r\n", 403),
            (&*page, "Host: 127.0.0.1.evil.example:8080\r\n", 403),
            (&*page, "Host: 127.0.0.1:8080\r\nHost: evil.example\r\n", 403),
            (&*page, "Host: 127.0.0.1:8080\r\nOrigin: http://evil.example\r\n", 403),
            (&*page, "Host: 127.0.0.1:8080\r\nOrigin: null\r\n", 403),
            ("/", "Host: 127.0.0.1:8080\r\n", 403),
            ("/?token=", "Host: 127.0.0.1:8080\r\n", 403),
            ("/?token=0123456789abcdef0123456789abcdee", "Host: 127.0.0.1:8080\r\n", 403),
            ("/?token=0123456789abcdef0123456789abcdef0", "Host: 127.0.0.1:8080\r\n", 403),
            ("/main.js", "Host: evil.example:8080\r\n", 403),
            ("/absent.js", "Host: 127.0.0.1:8080\r\n", 404),
            ("/../Cargo.toml", "Host: 127.0.0.1:8080\r\n", 404),
            ("//", "Host: 127.0.0.1:8080\r\n", 404),
            ("é", "Host: 127.0.0.1:8080\r\n", 400),
            ("*", "Host: 127.0.0.1:8080\r\n", 404),
        ] {
            assert_eq!(status(&gate, target, headers), expected, "{target} {headers}");
        }
    }

    #[test]
    fn the_socket_requires_the_origin_of_the_page_and_the_token() {
        let gate = gate("127.0.0.1:8080");
        let socket = format!("/socket?token={TOKEN}");
        let upgrade = "Connection: keep-alive, Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
        let host = "Host: 127.0.0.1:8080\r\n";
        for (target, headers, expected) in [
            (&*socket, format!("{host}Origin: http://127.0.0.1:8080\r\n{upgrade}"), 101),
            (&*socket, format!("Host: localhost:8080\r\nOrigin: http://localhost:8080\r\n{upgrade}"), 101),
            (&*socket, format!("{host}{upgrade}"), 403),
            (&*socket, format!("{host}Origin: http://evil.example\r\n{upgrade}"), 403),
            (&*socket, format!("{host}Origin: http://localhost:8080\r\n{upgrade}"), 403),
            (&*socket, format!("{host}Origin: http://127.0.0.1:8081\r\n{upgrade}"), 403),
            (&*socket, format!("{host}Origin: https://127.0.0.1:8080\r\n{upgrade}"), 403),
            (
                &*socket,
                format!("{host}Origin: http://127.0.0.1:8080\r\nOrigin: http://evil.example\r\n{upgrade}"),
                403,
            ),
            ("/socket", format!("{host}Origin: http://127.0.0.1:8080\r\n{upgrade}"), 403),
            (&*socket, format!("{host}Origin: http://127.0.0.1:8080\r\n"), 404),
        ] {
            assert_eq!(status(&gate, target, &headers), expected, "{target} {headers}");
        }
    }

    #[test]
    fn cards_are_lent_with_the_token_where_they_are_asked_for() {
        let [without, with] = [false, true]
            .map(|has_lenders| Gate::new("127.0.0.1:8080".parse().unwrap(), TOKEN.into(), has_lenders));
        let page = format!("http://127.0.0.1:8080/lend.html?token={TOKEN}");
        assert_eq!((without.lenders_url(), with.lenders_url()), (None, Some(page)));
        let host = "Host: 127.0.0.1:8080\r\nOrigin: http://127.0.0.1:8080\r\n";
        let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
        for (path, more, expected) in [
            ("/lend.html", "", 200),
            ("/card", upgrade, 101),
            ("/card", "", 404),
            ("/photoncard.wasm", "", 200),
        ] {
            let (target, headers) = (format!("{path}?token={TOKEN}"), format!("{host}{more}"));
            assert_eq!(status(&with, &target, &headers), expected, "{path}");
            assert_eq!(status(&without, &target, &headers), 404, "{path}");
            let is_open = path == "/photoncard.wasm";
            assert_eq!(status(&with, path, &headers), if is_open { 200 } else { 403 }, "{path}");
        }
        let foreign = host.replace("//127", "//evil.example:");
        assert_eq!(status(&with, &format!("/card?token={TOKEN}"), &format!("{foreign}{upgrade}")), 403);
    }

    #[test]
    fn a_server_of_all_addresses_is_reached_by_addresses_and_not_by_names() {
        let gate = gate("0.0.0.0:80");
        for (host, is_own) in [
            ("192.168.1.7", true),
            ("[::1]:80", true),
            ("localhost", true),
            ("evil.example", false),
            ("", false),
        ] {
            assert_eq!(gate.is_own(host), is_own, "{host}");
        }
    }
}
