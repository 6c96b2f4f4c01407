// The firmware's version, for its banner.
#pragma once

namespace shell {

constexpr char VERSION[] = "0.2.0";

}  // namespace shell
