#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "server/visit/visit_host.h"

namespace catgs::test {

using namespace std::chrono_literals;

/// A scene of this name that nobody draws.
inline std::shared_ptr<SceneEntry> named_scene(const std::string& id) {
  auto scene = std::make_shared<SceneEntry>();
  scene->facts.scene_id = id;
  return scene;
}

/// A server around a visit, that notes what the visit wants.
struct FakeHost final : VisitHost {
  AdmissionAnswer admission = Admission{};
  std::vector<ServerMessage> said;
  std::vector<OutgoingFrame> frames;
  std::vector<StreamSettings> opened;
  std::vector<std::uint64_t> drop_next;
  std::optional<CloseCode> closed;
  std::optional<EncoderChoice> other;  // than that of the admission, once

  AdmissionAnswer admit(const Hello&) override { return admission; }
  bool scene_awaited = false;
  bool scene_fails = false;
  int scenes_looked_for = 0;
  SceneAnswer find_scene(const std::string& id) override {
    ++scenes_looked_for;
    if (scene_fails) return ErrorMessage{ErrorCode::unknown_scene, "it fails", false};
    if (scene_awaited) return SceneAwaited{5s};
    return named_scene(id);
  }
  void sign(Welcome& welcome) override {
    welcome.session_id = "test";
    welcome.resume_token = "again";
  }
  void send(const ServerMessage& message) override { said.push_back(message); }
  std::vector<std::uint64_t> send(OutgoingFrame frame) override {
    frames.push_back(std::move(frame));
    return std::exchange(drop_next, {});
  }
  void close(CloseCode code, std::string_view) override { closed = code; }
  void open_stream(StreamSettings settings) override { opened.push_back(std::move(settings)); }
  std::optional<EncoderChoice> other_encoder(Fault) override { return std::exchange(other, {}); }

  template <typename T>
  int count() const {
    return static_cast<int>(std::ranges::count_if(
        said, [](const ServerMessage& m) { return std::holds_alternative<T>(m); }));
  }
  const ErrorMessage& last_error() const {
    for (auto it = said.rbegin(); it != said.rend(); ++it)
      if (const auto* error = std::get_if<ErrorMessage>(&*it)) return *error;
    throw std::logic_error("no error was said");
  }
};

}  // namespace catgs::test
