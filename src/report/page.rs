//! The shell of every page: head, contents and sections, in one file that loads nothing.

use super::text::escape;

/// The look that all pages share.
const STYLE: &str = include_str!("report.css");

/// Nothing may be loaded from anywhere, and the browser is told so. The plant in the report is code that is compiled there.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; img-src data:";

/// A section below the header: anchor, title, content.
pub type Section = (&'static str, &'static str, String);

/// What stands in the shell.
pub struct Page<'a> {
    /// What browser tabs and search lists show after the name of the program; plain text.
    pub title: &'a str,
    /// Style of this kind of page, beside the shared one.
    pub style: &'a str,
    /// What stands above the contents.
    pub header: &'a str,
    /// The sections, in their order.
    pub sections: &'a [Section],
    /// Data for the script: id and JSON in which no "<" stands.
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
