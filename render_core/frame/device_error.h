#pragma once

#include <exception>
#include <new>
#include <stdexcept>
#include <string>

#include "render_core/base/error.h"
#include "render_core/frame/renderer.h"

namespace catgs {

/// A device refused or failed. Thrown during set-up; on the frame path RenderStatus says the same.
/// After out_of_memory the device still serves others; after device_failed it may be lost until the
/// process ends.
class DeviceError : public std::runtime_error {
 public:
  DeviceError(RenderStatus::Code code, const std::string& message)
      : std::runtime_error(message), code_(code) {}

  [[nodiscard]] RenderStatus::Code status_code() const { return code_; }

 private:
  RenderStatus::Code code_;
};

/// Why a frame failed, as the caller sees it. A host out of memory is not a failed device.
inline RenderStatus status_of(const std::exception& error) {
  if (const auto* device = dynamic_cast<const DeviceError*>(&error))
    return {device->status_code(), error.what()};
  if (dynamic_cast<const std::bad_alloc*>(&error))
    return {RenderStatus::Code::out_of_memory, "the host is out of memory"};
  return {RenderStatus::Code::device_failed, error.what()};
}

/// The wanted CUDA devices cannot be used now: none was found, or one is too old, full, broken, or
/// of an architecture that this build has no code for. Some of these causes go away without a
/// change of the input.
class DevicesUnusable : public InputError {
 public:
  using InputError::InputError;
};

}  // namespace catgs
