# Run at every build. Writes OUTPUT only when the commit has changed, so that nothing is compiled
# without need.
execute_process(COMMAND git describe --always --dirty --abbrev=12 --exclude=*
                WORKING_DIRECTORY ${SOURCE_DIR} OUTPUT_VARIABLE commit RESULT_VARIABLE result
                OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(NOT result EQUAL 0)
  set(commit unknown)
  if(DEFINED ENV{CATGS_COMMIT})  # sources without their repository, in an image's build
    set(commit $ENV{CATGS_COMMIT})
  endif()
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT [[
#include "render_core/base/build_info.h"

namespace catgs {

const char* const build_version = "@VERSION@";
const char* const build_commit = "@commit@";

}  // namespace catgs
]] @ONLY)
