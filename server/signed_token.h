#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace catgs {

/// `payload.mac`, both base64url: the payload in clear and its HMAC-SHA256 under `key`. `purpose`
/// is part of what is signed, so that no token of one purpose can be taken for one of another under
/// the same key.
std::string sign_token(std::string_view purpose, std::string_view payload, std::string_view key);
/// The payload, if the token was signed for this purpose with this key. In constant time.
std::optional<std::string> read_signed_token(std::string_view purpose, std::string_view token,
                                             std::string_view key);

/// Compares digests, so that the time taken says nothing about where two texts differ.
bool equal_in_constant_time(std::string_view a, std::string_view b);

/// 32 bytes from the system's random source. Throws std::runtime_error when it has none.
std::string random_key();

}  // namespace catgs
