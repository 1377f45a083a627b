#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace catgs {

/// A tour's stops, as its author calls them.
struct TourTitles {
  std::string tour;
  std::vector<std::string> stops;
};

/// The titles in a document {"tours": …, "settings": …} about a scene, numbered as pages do: tours
/// without stops are left out, and the annotations of the SuperSplat viewer's settings are one tour
/// where there are no others. Empty where pages find no stops either.
std::vector<TourTitles> titles_of_tours(std::string_view document);

}  // namespace catgs
