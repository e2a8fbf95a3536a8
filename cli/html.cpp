#include "cli/html.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace crampfit::cli {

namespace {

const char* const style = R"(
:root { color-scheme: light; }
body { font: 15px/1.45 system-ui, sans-serif; color: #1b1b1b; background: #fff;
       max-width: 1080px; margin: 0 auto; padding: 1rem 1.5rem; }
h1 { font-size: 1.5rem; line-height: 1.2; margin: 0.5rem 0; overflow-wrap: anywhere; }
h2 { font-size: 1.1rem; border-bottom: 1px solid #d0d0d0; padding-bottom: 0.2rem; margin: 2rem 0 0.7rem; }
.kind { color: #595959; margin: 0; }
.warning { border-left: 4px solid #d55e00; background: #fdf3ec; padding: 0.4rem 0.8rem; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(420px, 100%), 1fr)); gap: 1rem 1.5rem; }
figure { margin: 0; }
figcaption { padding-left: 3rem; max-width: 32rem; }
figcaption, caption { font-size: 0.87rem; color: #404040; }
svg { width: 100%; height: auto; max-width: 560px; display: block; font: 11px system-ui, sans-serif; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 0.15rem 1.2rem; margin: 0.5rem 0; }
dt { color: #595959; }
dd { margin: 0; overflow-wrap: anywhere; }
svg.bar { width: 140px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.9rem; margin: 0.3rem 0; font-variant-numeric: tabular-nums; }
caption { text-align: left; padding-bottom: 0.3rem; }
th, td { text-align: left; padding: 0.2rem 0.7rem; border-bottom: 1px solid #e4e4e4; }
th { border-bottom-color: #808080; }
td.number { text-align: right; }
pre { font: 0.8rem/1.4 ui-monospace, monospace; background: #f6f6f4; border: 1px solid #e4e4e4; padding: 0.7rem;
      white-space: pre-wrap; overflow-wrap: anywhere; }
.slider label { display: flex; gap: 0.8rem; align-items: center; max-width: 560px; }
.slider input { flex: 1; }
@media screen { [data-frame]:not(.shown) { display: none; } }
@media print {
  @page { margin: 15mm; }
  body { font-size: 10pt; max-width: none; padding: 0; }
  .slider, [data-frame]:not(.last) { display: none; }
  .figures { display: block; }
  figure { display: inline-block; width: 48%; margin-right: 1%; vertical-align: top; }
  figure, tr { break-inside: avoid; }
  .scroll { overflow: visible; }
  table { font-size: 8pt; }
  th, td { padding: 0.15rem 0.4rem; overflow-wrap: anywhere; print-color-adjust: exact; }
  h2 { break-after: avoid; }
  pre, .warning { border-width: 1px 1px 1px 4px; background: none; }
}
)";

// Without it, and in print, the last frame is what is seen. No character in it means anything to XML.
const char* const script = R"(
(function () {
  var slider = document.getElementById("frame");
  if (!slider) { return; }
  function show() {
    document.querySelectorAll("[data-frame]").forEach(function (part) {
      part.classList.toggle("shown", part.getAttribute("data-frame") === slider.value);
    });
    slider.setAttribute("aria-valuetext", document.querySelector("p.shown").textContent);
  }
  slider.addEventListener("input", show);
  slider.closest(".slider").hidden = false;
  show();
}());
)";

/// How many bytes the character of UTF-8 takes that begins there; 0 for none, or one that XML 1.0 (2008, section 2.2) forbids.
std::size_t character_length(std::string_view text) {
    const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
    const unsigned first = byte(0);
    if (first < 0x80) return first >= 0x20 || first == '\t' || first == '\n' || first == '\r' ? 1 : 0;
    if (first < 0xC2 || first > 0xF4) return 0;
    const std::size_t length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
    unsigned code = first & (0xFFu >> (length + 1));
    for (std::size_t i = 1; i < length; ++i) {
        if ((byte(i) & 0xC0u) != 0x80u) return 0;
        code = code << 6 | (byte(i) & 0x3Fu);
    }
    const unsigned least = length == 2 ? 0x80 : length == 3 ? 0x800 : 0x10000;
    const bool is_surrogate = code >= 0xD800 && code <= 0xDFFF;
    return code < least || code > 0x10FFFF || is_surrogate || code == 0xFFFE || code == 0xFFFF ? 0 : length;
}

bool looks_like_number(const std::string& text) {
    return !text.empty() && (std::string_view("0123456789+-.").find(text.front()) != std::string_view::npos || text == "nan" ||
                             text == "inf" || text == "–");
}

}  // namespace

std::string escaped(const std::string& text) {
    std::string result;
    for (std::size_t i = 0; i < text.size();) {
        const std::size_t length = character_length(std::string_view(text).substr(i));
        switch (length == 0 ? '\0' : text[i]) {
        case '\0':
            result += "\uFFFD";
            break;
        case '&':
            result += "&amp;";
            break;
        case '<':
            result += "&lt;";
            break;
        case '>':
            result += "&gt;";
            break;
        case '"':
            result += "&quot;";
            break;
        case '\'':
            result += "&#39;";
            break;
        default:
            result.append(text, i, length);
        }
        i += std::max<std::size_t>(1, length);
    }
    return result;
}

std::string png_address(const std::vector<std::uint8_t>& bytes) {
    // Base 64 as in RFC 4648 (Josefsson 2006), section 4.
    const char* const digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text = "data:image/png;base64,";
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
        unsigned bits = 0;
        for (std::size_t k = 0; k < 3; ++k) bits = bits << 8 | (k < count ? bytes[i + k] : 0u);
        for (std::size_t k = 0; k < 4; ++k) text += k <= count ? digits[bits >> (18 - 6 * k) & 63u] : '=';
    }
    return text;
}

std::string section(const std::string& heading_text, const std::string& markup) {
    return fmt::format("<section>\n<h2>{}</h2>\n{}</section>\n", escaped(heading_text), markup);
}

std::string paragraph(const std::string& text) { return fmt::format("<p>{}</p>\n", escaped(text)); }

std::string verbatim(const std::string& text) { return fmt::format("<pre>{}</pre>\n", escaped(text)); }

std::string facts(const std::vector<std::pair<std::string, std::string>>& texts) {
    std::string markup = "<dl>\n";
    for (const auto& [name, value] : texts) markup += fmt::format("<dt>{}</dt><dd>{}</dd>\n", escaped(name), escaped(value));
    return markup + "</dl>\n";
}

std::string table(const std::string& caption_text, const std::vector<std::string>& heads,
                  const std::vector<std::vector<std::string>>& rows) {
    std::string markup = fmt::format("<div class=\"scroll\"><table>\n<caption>{}</caption>\n<thead><tr>", escaped(caption_text));
    for (const std::string& head : heads) markup += fmt::format("<th scope=\"col\">{}</th>", escaped(head));
    markup += "</tr></thead>\n<tbody>\n";
    for (const std::vector<std::string>& row : rows) {
        markup += "<tr>";
        for (const std::string& cell : row)
            markup += fmt::format("<td{}>{}</td>", looks_like_number(cell) ? " class=\"number\"" : "", escaped(cell));
        markup += "</tr>\n";
    }
    return markup + "</tbody></table></div>\n";
}

std::string figures(const std::vector<std::string>& markups) {
    std::string all = "<div class=\"figures\">\n";
    for (const std::string& markup : markups) all += markup;
    return all + "</div>\n";
}

std::string slider(const std::string& label_text, const std::vector<std::string>& sentences) {
    std::string markup =
        fmt::format("<div class=\"slider\" hidden=\"hidden\"><label>{1} <input id=\"frame\" type=\"range\" min=\"0\" "
                    "max=\"{0}\" value=\"{0}\" autocomplete=\"off\" /></label></div>\n",
                    sentences.size() - 1, escaped(label_text));
    for (std::size_t i = 0; i < sentences.size(); ++i)
        markup += fmt::format("<p data-frame=\"{}\"{}>{}</p>\n", i, i + 1 == sentences.size() ? " class=\"shown last\"" : "",
                              escaped(sentences[i]));
    return markup;
}

std::string page(const std::string& title_text, const std::string& body_markup) {
    return fmt::format("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\" />\n"
                       "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src "
                       "'unsafe-inline'; script-src 'unsafe-inline'\" />\n"
                       "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\" />\n"
                       "<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n{}<script>{}</script>\n</body>\n</html>\n",
                       escaped(title_text), style, body_markup, script);
}

}  // namespace crampfit::cli
