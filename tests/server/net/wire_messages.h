#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <fmt/format.h>

#include "proto/catgs.pb.h"
#include "server/net/wire.h"

namespace catgs {

inline std::variant<ClientMessage, wire::ParseError> parse(const v1::ClientMessage& message) {
  const std::string text = message.SerializeAsString();
  return wire::parse_client_message(std::as_bytes(std::span(text)));
}

template <typename T>
T parsed(const std::vector<std::byte>& bytes) {
  return std::get<T>(std::get<ClientMessage>(wire::parse_client_message(bytes)));
}

template <typename T>
T parsed(const v1::ClientMessage& message) {
  return std::get<T>(std::get<ClientMessage>(parse(message)));
}

/// The field for which a message is refused; empty if it is taken.
inline std::string wrong_field(const v1::ClientMessage& message) {
  const auto result = parse(message);
  const auto* error = std::get_if<wire::ParseError>(&result);
  return error ? error->what.substr(0, error->what.find_first_of(": ")) : "";
}

inline std::string hex(const std::vector<std::byte>& bytes) {
  std::string text;
  for (const std::byte b : bytes) text += fmt::format("{:02x}", std::to_integer<unsigned>(b));
  return text;
}

}  // namespace catgs
