#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

/// Pieces of a page in HTML that an XML parser reads as well. Functions that take "text" escape it; those that take "markup" do
/// not.
namespace crampfit::cli {

/// Text as it may stand in an element or an attribute: what means something to HTML is escaped, bytes that are no UTF-8 and
/// characters that XML forbids become U+FFFD.
std::string escaped(const std::string& text);

/// A picture as the address of itself: nothing has to be fetched.
std::string png_address(const std::vector<std::uint8_t>& bytes);

/// A part of the page under its heading.
std::string section(const std::string& heading_text, const std::string& markup);

std::string paragraph(const std::string& text);

/// Text with its lines and spaces as they are.
std::string verbatim(const std::string& text);

/// Names and values, one below the other.
std::string facts(const std::vector<std::pair<std::string, std::string>>& texts);

/// A table of texts under its heads; cells that begin as a number does stand to the right.
std::string table(const std::string& caption_text, const std::vector<std::string>& heads,
                  const std::vector<std::vector<std::string>>& rows);

/// Figures side by side as far as there is room.
std::string figures(const std::vector<std::string>& markups);

/// A slider through the frames of a page's figures, each with its sentence; one a page.
std::string slider(const std::string& label_text, const std::vector<std::string>& sentences);

/// The whole page: the style, the script that moves the slider, and a policy that forbids the browser any request.
std::string page(const std::string& title_text, const std::string& body_markup);

}  // namespace crampfit::cli
