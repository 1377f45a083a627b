#pragma once

#include <array>
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

/// SHA-256. Digests are compared, so that the time taken says nothing about where two texts differ.
using TokenDigest = std::array<unsigned char, 32>;
TokenDigest digest_of(std::string_view text);
bool equal_in_constant_time(const TokenDigest& a, const TokenDigest& b);

/// 32 bytes from the system's random source. Throws std::runtime_error when it has none.
std::string random_key();
/// 128 bits of it, as hexadecimal digits: no two are alike, whichever server made them.
std::string random_id();

}  // namespace catgs
