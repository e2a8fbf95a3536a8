#pragma once

#include "imaging/virtual_camera.hpp"
#include "tests/cli/command.hpp"

/// Writes a gray picture as PGM, which needs no library.
inline std::string write_pgm(const Command& command, const std::string& name, const crampfit::GrayPicture& picture) {
    const std::string head = "P5\n" + std::to_string(picture.columns) + " " + std::to_string(picture.rows) + "\n255\n";
    return command.folder.write(name, head + std::string(picture.gray.begin(), picture.gray.end())).string();
}
