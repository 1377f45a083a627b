// The part of Boost.Asio that needs OpenSSL; server/asio.cpp has the rest.
#include <boost/asio/ssl/impl/src.hpp>
