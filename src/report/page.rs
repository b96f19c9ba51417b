//! The shell of every page: head, table of contents and sections, in one file that loads nothing.

use super::text::escape;

/// Style that all pages share.
const STYLE: &str = include_str!("report.css");

/// Content security policy: the browser is told to load nothing from anywhere. WebAssembly is allowed, because the report compiles the plant in the browser.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; img-src data:";

/// A section below the header: anchor, title, content.
pub type Section = (&'static str, &'static str, String);

/// Content of the shell.
pub struct Page<'a> {
    /// Title in browser tabs and bookmarks, after the name of the program; plain text.
    pub title: &'a str,
    /// Style of this kind of page, in addition to the shared one.
    pub style: &'a str,
    /// Content above the table of contents.
    pub header: &'a str,
    /// The sections, in their order.
    pub sections: &'a [Section],
    /// Data for the script: element id, and JSON without the character "<".
    pub data: &'a [(&'a str, String)],
    /// The script; may be empty.
    pub script: &'a str,
}

/// The whole page as one HTML document.
pub fn html(page: &Page) -> String {
    let links: String = page.sections.iter().map(|(id, title, _)| format!("<li><a href=\"#{id}\">{title}</a></li>")).collect();
    let body: String = page
        .sections
        .iter()
        .map(|(id, title, content)| {
            format!("<section id=\"{id}\" aria-labelledby=\"{id}-title\"><h2 id=\"{id}-title\">{title}</h2>\n{content}</section>\n")
        })
        .collect();
    let data: String =
        page.data.iter().map(|(id, json)| format!("<script type=\"application/json\" id=\"{id}\">{json}</script>\n")).collect();
    let script = if page.script.is_empty() {
        String::new()
    } else {
        format!("<script>\n(() => {{\n\"use strict\";\n{}}})();\n</script>\n", page.script)
    };
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<link rel=\"icon\" href=\"data:,\">\n\
         <title>Kisspoint: {title}</title>\n<style>\n{STYLE}{style}</style>\n</head>\n<body>\n\
         <a class=\"skip\" href=\"#main\">Skip to the result</a>\n\
         <main id=\"main\" tabindex=\"-1\">\n{header}<nav aria-label=\"Contents\"><ol>{links}</ol></nav>\n{body}</main>\n\
         {data}{script}</body>\n</html>\n",
        title = escape(page.title),
        style = page.style,
        header = page.header,
    )
}
