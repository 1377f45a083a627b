// Boost.Asio's own code, compiled once instead of in each file that includes it:
// BOOST_ASIO_SEPARATE_COMPILATION.
#include <boost/asio/impl/src.hpp>
