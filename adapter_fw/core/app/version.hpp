// The firmware's version, for its banner.
#pragma once

namespace app {

constexpr char VERSION[] = "0.2.0";

}  // namespace app
